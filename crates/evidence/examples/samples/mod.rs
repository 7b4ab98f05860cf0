//! Made-up reports, plausible and always the same, for examples and tests.
use guardsplat_codeword::{Message, Reading};
use guardsplat_evidence::{
    Audience, Bit, Decision, Embedding, Evidence, EvidenceKind, Found, History, HypothesisGroup, HypothesisKind, Input,
    Key, Model, Multiplicity, Picture, Reason, Registration, Role, SCHEMA, Sha256, SigningKey, Target, Timestamp,
    Tried, VERSION, Verdict, Verification, View, Worker,
};

/// The service's key; of examples, so everybody's.
pub fn key() -> SigningKey {
    SigningKey::from_bytes(&[7; 32])
}

/// One report of each kind and verdict, by name.
pub fn all() -> Vec<(&'static str, Evidence)> {
    let found = matching();
    let strangers = found.for_stranger();
    vec![
        ("match", found),
        ("match-stranger", strangers),
        ("no-match", verify(decided(33, Tried::once()))),
        ("inconclusive-weak", verify(undecided(Reason::WeakReading))),
        ("inconclusive-no-message", verify(undecided(Reason::NothingToCompare))),
        ("inconclusive-few-bits", verify(few_bits())),
        ("inconclusive-registered-later", verify(registered_later())),
        ("unknown-key", verify(unknown_key())),
        ("embed", embed(true)),
        ("embed-missed", embed(false)),
        ("hostile", hostile()),
    ]
}

/// A match found by a search over ten assets in several framings.
pub fn matching() -> Evidence {
    let framing = |kind, variants, tries: Option<u64>| HypothesisGroup {
        kind,
        variants,
        pooled: tries.is_none(),
        tries,
    };
    let tried = Tried {
        framings: vec![
            framing(HypothesisKind::AsGiven, 1, Some(2)),
            framing(HypothesisKind::Estimated, 1, Some(4)),
            framing(HypothesisKind::Crop, 5, None),
            framing(HypothesisKind::QuarterTurn, 3, Some(16)),
            framing(HypothesisKind::Mirrored, 1, Some(16)),
            framing(HypothesisKind::Scaling, 2, None),
        ],
        owners: 2,
        assets: 10,
        paid: Some(Multiplicity {
            assets: 10,
            readings: 1,
        }),
    };
    let mut evidence = verify(decided(62, tried));
    evidence.views = views(2);
    evidence
}

/// A report with texts that mean harm.
pub fn hostile() -> Evidence {
    let script = "</script><script>alert(1)</script><img src=x onerror=\"alert('2')\">";
    let mut evidence = matching();
    let names = [
        script.to_owned(),
        "\u{202e}ylp.eman\u{202c} \" onload=\"x\" '&lt;".into(),
        "<!-- page signature ed25519 --> src=\"data:image/png;base64,AAAA\"".into(),
        "x".repeat(1000),
    ];
    evidence.inputs = names.into_iter().map(|name| input(Role::Suspect, &name)).collect();
    evidence.job = script.into();
    evidence.views[0].name = format!("{script}\u{200f}");
    if let Some(verification) = &mut evidence.verification {
        verification.note = Some(script.into());
        verification.found = Some(Found {
            owner: script.into(),
            asset: "קובץ <b>\u{2066}".into(),
            payload: Some("c0ffee".into()),
        });
    }
    evidence
}

/// A marking, with its message read back.
pub fn embed(reached: bool) -> Evidence {
    let target = Target {
        bit_accuracy: Some(0.97),
        psnr_db: Some(36.0),
        ssim: Some(0.98),
        lpips: None,
    };
    let missed = if reached {
        vec![]
    } else {
        vec!["PSNR is 34.12 dB, at least 36.00 dB were asked for".into()]
    };
    let mut verification = decided(64, Tried::once());
    verification.found = None;
    Evidence {
        kind: EvidenceKind::Embed,
        inputs: vec![
            input(Role::Original, "garden statue.ply"),
            input(Role::Marked, "marked.ply"),
        ],
        embedding: Some(Embedding {
            payload: Some("c0ffee42c0ffee42".into()),
            bit_accuracy: 0.984375,
            bit_accuracy_worst_view: 0.921875,
            psnr_db: Some(if reached { 38.27 } else { 34.12 }),
            ssim: 0.9912,
            lpips: Some(0.0043),
            target,
            missed,
            gaussians: 1_234_567,
            changed_gaussians: 1_198_004,
        }),
        views: views(3),
        ..verify(verification)
    }
}

/// A report of a verification.
pub fn verify(verification: Verification) -> Evidence {
    Evidence {
        schema: SCHEMA.into(),
        version: VERSION,
        audience: Audience::Owner,
        kind: EvidenceKind::Verify,
        job: "jobs/0192f3c4-7a51-7d3e-9b1f-5a4c2e8d6f10".into(),
        started: "2026-03-14T09:26:53Z".parse().expect("a time"),
        finished: "2026-03-14T09:27:31.5Z".parse().expect("a time"),
        engine: "guardsplat-worker 0.1.0".into(),
        device: "NVIDIA GeForce RTX 4070 (Vulkan)".into(),
        worker: Some(Worker {
            name: "render-7".into(),
            attempt: 1,
        }),
        model: Model {
            name: "guardsplat-clip".into(),
            sha256: Sha256::of(b"weights"),
        },
        key: Key {
            id: "keys/website-2026".into(),
        },
        inputs: vec![
            input(Role::Suspect, "screenshot 2026-03-12 at 18.04.11.png"),
            input(Role::Suspect, "IMG_4711.jpeg"),
        ],
        verification: Some(verification),
        embedding: None,
        views: views(1),
    }
}

/// A verification that compared 64 bits, so many of which agree.
pub fn decided(matched: u32, mut tried: Tried) -> Verification {
    tried.paid.get_or_insert(Multiplicity { assets: 1, readings: 1 });
    let strip = strip(64, matched as usize);
    let hypotheses = tried.hypotheses(tried.parts()[0]);
    let decision = Decision {
        corrected: Some((64 - matched).min(3)),
        ..Decision::new(64, (matched, rank_sum(&strip)), hypotheses, 1e-6)
    };
    let verdict = decision.verdict();
    Verification {
        verdict,
        reason: None,
        note: None,
        tried,
        views: 20,
        history: Some(history("2025-11-02T08:00:00Z")),
        found: (verdict == Verdict::Match).then(|| Found {
            owner: "Atelier Morgenrot".into(),
            asset: "Garden statue".into(),
            payload: Some("c0ffee42c0ffee42".into()),
        }),
        strip,
        decision: Some(decision),
    }
}

/// What was before: the suspect was first seen in March, and the asset registered then.
fn history(registered: &str) -> History {
    let time = |text: &str| text.parse::<Timestamp>().expect("a time");
    History {
        first_seen: time("2026-03-12T18:04:11Z"),
        readings_of_key: 17,
        assets_of_owner: Some(12),
        asset: Some(Registration {
            asset: "assets/0192a000-0000-7000-8000-000000000001".into(),
            commitment: "commitments/0192a000-0000-7000-8000-000000000002".into(),
            sequence: 31,
            hash: Sha256::of(b"commitment"),
            time: time(registered),
            revealed: None,
        }),
    }
}

/// What would be a match, of an asset that is younger than its suspect.
fn registered_later() -> Verification {
    let mut verification = decided(62, Tried::once());
    verification.verdict = Verdict::Inconclusive;
    verification.reason = Some(Reason::RegisteredLater);
    verification.found = None;
    verification.history = Some(history("2026-03-13T10:00:00Z"));
    verification
}

fn undecided(reason: Reason) -> Verification {
    let mut verification = decided(38, Tried::once());
    verification.verdict = Verdict::Inconclusive;
    verification.reason = Some(reason);
    if reason == Reason::NothingToCompare {
        verification.decision = None;
        verification.strip.iter_mut().for_each(|bit| bit.wanted = None);
    }
    verification
}

fn few_bits() -> Verification {
    let mut verification = undecided(Reason::TooFewBits);
    verification.decision = Some(Decision::new(16, (16, 136), 1, 1e-6));
    verification.strip = strip(16, 16);
    verification
}

fn unknown_key() -> Verification {
    Verification {
        verdict: Verdict::UnknownKey,
        views: 0,
        decision: None,
        strip: vec![],
        ..decided(32, Tried::once())
    }
}

/// Bits by a simple generator; the last ones of a shuffle differ, of a mark because they were hardly read.
fn strip(bits: usize, matched: usize) -> Vec<Bit> {
    let bit = |i: usize| {
        let noise = (i * 2_654_435_761) >> 7;
        let differs = (i * 37 + 11) % bits >= matched;
        let weak = differs && 4 * matched > 3 * bits;
        let confidence = if weak { 0.04 } else { 0.55 } + (noise % 40) as f64 / 100.0;
        let read = noise.is_multiple_of(2);
        Bit {
            wanted: Some(read != differs),
            read,
            confidence: Some(confidence),
            logit: Some(confidence * if read { 6.5 } else { -6.5 }),
        }
    };
    (0..bits).map(bit).collect()
}

/// The sum of the ranks of the bits that match, ranked by the size of their logits.
fn rank_sum(strip: &[Bit]) -> u32 {
    let logits: Vec<f32> = strip.iter().filter_map(|bit| Some(bit.logit? as f32)).collect();
    let wanted: Vec<bool> = strip.iter().filter_map(|bit| bit.wanted).collect();
    let message = Message::from_bits(&wanted).expect("a message");
    Reading::from_logits(&logits)
        .and_then(|reading| reading.rank_sum(&message))
        .expect("a reading of it")
}

fn input(role: Role, name: &str) -> Input {
    Input {
        role,
        name: Some(name.into()),
        bytes: 11_300_000 + name.len() as u64,
        sha256: Sha256::of(name.as_bytes()),
    }
}

/// Views with all three pictures.
pub fn views(count: usize) -> Vec<View> {
    let view = |i: usize| {
        let (original, read) = (ball(i, 0), ball(i, 3));
        View {
            name: format!("View {}", i + 1),
            difference: Some(Picture::difference(&original, &read).expect("pictures of one size")),
            original: Some(original),
            read,
        }
    };
    (0..count).map(view).collect()
}

/// A lit ball over a chequered floor, with a faint pattern as strong as `mark` in 255ths.
fn ball(turn: usize, mark: i32) -> Picture {
    const SIDE: usize = 192;
    let light = 0.6 + turn as f32;
    let mut rgb = Vec::with_capacity(SIDE * SIDE * 3);
    for y in 0..SIDE {
        for x in 0..SIDE {
            let (u, v) = (x as f32 / SIDE as f32 * 2.0 - 1.0, y as f32 / SIDE as f32 * 2.0 - 0.9);
            let depth = 0.5 - u * u - v * v;
            let colour = if depth > 0.0 {
                let shade = (u * light.cos() + v * light.sin() + depth.sqrt()).clamp(0.05, 1.0);
                [220.0 * shade, 150.0 * shade + 20.0, 90.0 * shade + 30.0]
            } else if v > 0.2 {
                let tile = (((u / v * 4.0 + 40.0) as i32) + (4.0 / v) as i32) % 2;
                [[60.0, 70.0, 80.0], [180.0, 180.0, 170.0]][tile as usize]
            } else {
                [120.0 + 80.0 * v, 160.0 + 60.0 * v, 220.0]
            };
            let wave = ((x as f32 * 0.31 + turn as f32).sin() * (y as f32 * 0.23).cos() * mark as f32).round();
            rgb.extend(colour.map(|c| (c + wave).clamp(0.0, 255.0) as u8));
        }
    }
    Picture::from_rgb(SIDE as u32, SIDE as u32, &rgb).expect("a picture")
}
