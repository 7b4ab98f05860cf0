//! Makes a key: a secret, the projection that fits its own messages, and the decoder trained behind it.
use burn::tensor::{Int, Tensor, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha20Rng;

use super::natural;
use crate::clip::Clip;
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::message::key::Secret;
use crate::message::tokens::hmac_sha256;
use crate::message::{
    CONTEXT, ClipIdentity, Decoding, FitOptions, Key, KeyOptions, Message, Projection, TokenTable, fit, train, training,
};
use crate::picture::Picture;
use crate::stop::Stop;

/// Random messages whose text features the projection is fitted to.
const FITTED_MESSAGES: usize = 512;
/// Sequences given to the text tower at once.
const BATCH: usize = 64;

/// What creating a key does, for a progress display.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NewKey {
    /// Natural pictures read, of so many.
    Pictures(usize, usize),
    /// The decoder's training.
    Decoder(training::Progress),
}

/// Makes a key for `clip`, which must have both towers, from features of natural `pictures` of one size.
///
/// The projection is fitted to messages of this key's own token table: their features have a centre of their own, and
/// image features must be centred alike to be read by the same decoder. `projection` decides what it drops.
///
/// # Errors
/// A length outside its limits, a CLIP without room for the key's sequences, too few pictures, those of the pictures, those
/// of [`train`], and [`Error::Stopped`].
pub fn create_key(
    options: &KeyOptions,
    projection: FitOptions,
    clip: &Clip,
    identity: ClipIdentity,
    compute: &Compute,
    pictures: impl Iterator<Item = Result<Picture>>,
    stop: &Stop,
    mut progress: impl FnMut(NewKey),
) -> Result<Key> {
    guardsplat_codeword::MessageLength::new(options.bits)?;
    let bits_per_token = options.bits_per_token();
    let secret = match options.seed {
        Some(seed) => Secret::from_seed(seed),
        None => Secret::random()?,
    };
    let table = TokenTable::new(secret.expose(), options.bits, bits_per_token)?;
    let length = table.positions() + 2;
    check_text_tower(clip, &identity, length)?;
    let mut encode = |sequences: &[[i64; CONTEXT]]| {
        stop.check()?;
        text_features(clip, compute, length, sequences)
    };

    let images = natural::features(clip, compute, pictures, options.robust_to, stop, |done| {
        progress(NewKey::Pictures(done, natural::count()));
    })?;
    let projection = fit_projection(&secret, &table, &images, clip.dim(), projection, &mut encode)?;

    // The training's seed follows from the secret, so that one seed decides the whole file.
    let [a, b, c, d, e, f, g, h, ..] = hmac_sha256(secret.expose(), &[b"guardsplat training seed v1"]);
    let training = training::TrainingOptions {
        seed: u64::from_le_bytes([a, b, c, d, e, f, g, h]),
        ..options.training.clone()
    };
    let trained = train(&table, &projection, encode, &training, &compute.device, stop, |p| {
        progress(NewKey::Decoder(p))
    })?;
    Ok(Key {
        secret,
        seed: options.seed,
        bits_per_token,
        clip: identity,
        decoding: Decoding::Clip {
            projection,
            decoder: trained.weights,
        },
        accuracy_unseen: trained.accuracy_unseen,
        accuracy_unseen_noisy: trained.accuracy_unseen_noisy,
    })
}

fn fit_projection(
    secret: &Secret,
    table: &TokenTable,
    images: &[f32],
    width: usize,
    options: FitOptions,
    encode: &mut impl FnMut(&[[i64; CONTEXT]]) -> Result<Vec<f32>>,
) -> Result<Projection> {
    let mut rng = ChaCha20Rng::from_seed(hmac_sha256(secret.expose(), &[b"guardsplat projection messages v1"]));
    let sequences = (0..FITTED_MESSAGES)
        .map(|_| table.sequence(&Message::random(table.bits(), &mut rng)?))
        .collect::<Result<Vec<_>>>()?;
    let mut texts = Vec::with_capacity(FITTED_MESSAGES * width);
    for chunk in sequences.chunks(BATCH) {
        texts.extend(encode(chunk)?);
    }
    fit(images, &texts, width, options)
}

/// Features of token sequences. What follows the end token has no influence and is cut off.
fn text_features(clip: &Clip, compute: &Compute, length: usize, sequences: &[[i64; CONTEXT]]) -> Result<Vec<f32>> {
    let tokens: Vec<i64> = sequences.iter().flat_map(|s| &s[..length]).copied().collect();
    let tokens = TensorData::new(tokens, [sequences.len(), length]);
    let tokens = Tensor::<2, Int>::from_data(tokens, &compute.device);
    let features = clip.text_features(tokens).try_into_vec_as::<f32>();
    features.map_err(|e| Error::Device {
        device: compute.name.clone(),
        reason: e.to_string(),
    })
}

fn check_text_tower(clip: &Clip, identity: &ClipIdentity, length: usize) -> Result<()> {
    let text = &clip.config.text;
    let reason = if text.vocab_size < 49408 {
        format!("its vocabulary has {} tokens, keys use 49408", text.vocab_size)
    } else if text.context_length < length {
        format!("its texts have {} tokens, the key's need {length}", text.context_length)
    } else {
        return Ok(());
    };
    Err(Error::BadModel {
        name: identity.name.clone(),
        reason,
    })
}
