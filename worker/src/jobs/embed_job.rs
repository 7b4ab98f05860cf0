//! `embed` jobs: the same bytes as the command's for the same seed.
use std::time::{Duration, Instant};

use guardsplat_codeword::Hypothesis;
use guardsplat_engine::Error as EngineError;
use guardsplat_engine::embed::{Job, Outcome, embed};
use guardsplat_engine::message::Key;
use guardsplat_engine::picture::Picture;
use guardsplat_engine::quality::{PictureFormat, encode_picture};
use guardsplat_engine::scene::BadRows;
use guardsplat_proto::v1::complete_job_request::Result as Done;
use guardsplat_proto::v1::{Credentials, EmbedResult, EmbedSpec, SeenView};
use guardsplat_soft_binding::Value;

use super::attempt::{Attempt, Input, Outcome as Finished};
use super::convert;
use super::credentials::{self, Order, Signed};
use super::error::{Error, Result};
use super::transfer::Content;
use crate::credentials_program::binding_key;
use guardsplat_operations::thumbnails::small_png;
use guardsplat_operations::{comparison_sheet, load};

/// Views of the evidence.
const SHOWN: usize = 3;

/// A scene that was marked.
struct Marked {
    outcome: Outcome,
    sheet: Vec<u8>,
    views: Vec<SeenView>,
    credentials: Option<Signed>,
    device: String,
    clip: String,
    duration: Duration,
}

/// What a marked scene is called.
fn marked_name(outcome: &Outcome) -> String {
    format!("marked.{}", outcome.format.extension())
}

/// Fetches scene and key, marks, signs content credentials where they are wanted, stores the marked scene and a picture
/// of what changed.
pub async fn carry_out(attempt: &mut Attempt<'_>, spec: &EmbedSpec) -> Result<Finished> {
    let settings = convert::settings(spec)?;
    let cameras_file = Some(spec.cameras.as_str()).filter(|name| !name.is_empty());
    let names: Vec<&str> = std::iter::once(spec.scene.as_str()).chain(cameras_file).collect();
    let mut inputs = attempt.download(&names).await?;
    let cameras_file = cameras_file.and_then(|_| inputs.pop()).map(|input| input.path);
    let Input {
        path: input,
        name: original_name,
    } = inputs.swap_remove(0);
    let order = spec.credentials.then(|| Order {
        certificate: attempt.certificate.clone(),
        folder: attempt.folder.to_owned(),
        original_name,
    });
    let key_file = attempt.download_key().await?;
    // Its format, and so its name, is known when it is there.
    let output = attempt.folder.join("marked");
    // The word of an asset is not told, nor what is read in its place.
    let secret = !spec.asset.is_empty();
    let (name, message, force) = (spec.key.clone(), spec.message.clone(), spec.force);
    let bad_rows = BadRows::ignored_if(spec.ignore_bad_rows);
    let marked_file = Content::File(output.clone());
    let rate = attempt.lease.false_positive_rate;
    let work = attempt.compute(move |cache, stop, reporter| {
        let start = Instant::now();
        order.as_ref().map_or(Ok(()), |order| order.check(&input))?;
        let key = Key::from_bytes(&name, &key_file)?;
        drop(key_file);
        let message = key.message(&message)?;
        let cameras = load::cameras(cameras_file.as_deref())?;
        let engine = cache.engine(&name, &key, load::Work::Marking, rate, stop)?;
        let device = engine.compute.name.clone();
        let job = Job {
            input: &input,
            output: &output,
            message: &message,
            settings: &settings,
            cameras: &cameras,
            force,
            bad_rows,
        };
        let outcome = embed(engine, &job, &mut |progress| {
            if let Some(progress) = convert::embedding_progress(&progress) {
                reporter.tell(progress);
            }
        })?;
        if !outcome.written {
            return Err(Error::TargetMissed(outcome.missed.join(", ")));
        }
        let sheet = comparison_sheet::of(&outcome.verification.pairs)?;
        let sheet = encode_picture(&sheet, PictureFormat::Png).map_err(|reason| EngineError::BadPicture {
            path: comparison_sheet::NAME.into(),
            reason,
        })?;
        // Only the evidence of an asset shows them.
        let shown = if secret { SHOWN } else { 0 };
        let pairs = outcome.verification.pairs.iter().take(shown).enumerate();
        let view = |(index, (original, read)): (usize, &(Picture, Picture))| {
            Ok(SeenView {
                name: format!("view {}", index + 1),
                read: small_png(read)?,
                original: small_png(original)?,
            })
        };
        let views = pairs.map(view).collect::<guardsplat_engine::Result<_>>()?;
        let sign = |order: &Order| {
            let value = Value::seal(binding_key(&key, &key.id()), &message);
            let value = value.map_err(|error| Error::BadJob(error.to_string()))?;
            order.sign(&input, &output, &marked_name(&outcome), &value)
        };
        let credentials = order.as_ref().map(sign).transpose()?;
        Ok(Marked {
            outcome,
            sheet,
            views,
            credentials,
            device,
            clip: key.clip.name.clone(),
            duration: start.elapsed(),
        })
    });
    let marked = work.await?;
    let scene = attempt
        .upload(&marked_name(&marked.outcome), marked_file, false)
        .await?;
    let comparison = attempt
        .upload(comparison_sheet::NAME, Content::Bytes(marked.sheet), false)
        .await?;
    let credentials = match marked.credentials {
        Some(Signed { path, told }) => Some(Credentials {
            artifact: attempt.upload(credentials::NAME, Content::File(path), false).await?,
            ..told
        }),
        None => None,
    };
    // What was read back of all views, for the evidence of an asset.
    let readings = vec![convert::framed_reading(
        Hypothesis::default(),
        &marked.outcome.verification.reading,
    )];
    let result = Done::EmbedResult(EmbedResult {
        scene,
        comparison,
        duration: convert::duration(marked.duration),
        device: marked.device,
        clip: marked.clip,
        credentials,
        ..convert::embed_result(&marked.outcome)
    });
    Ok(Finished {
        result,
        readings,
        views: marked.views,
    })
}
