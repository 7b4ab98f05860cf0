//! Makes a key: a secret, the projection that fits its own messages, and the decoder trained behind it.
use burn::tensor::{Int, Tensor, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha20Rng;

use super::{ClipIdentity, Decoding, Key, KeyOptions, Secret, natural_images};
use crate::clip::Clip;
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::message::tokens::hmac_sha256;
use crate::message::{CONTEXT, FitOptions, Message, Projection, TokenTable, fit, train, training};
use crate::picture::Picture;
use crate::stop::Stop;
use guardsplat_codeword::{MessageCode, MessageLength};

/// Random messages whose text features the projection is fitted to.
const FITTED_MESSAGES: usize = 512;
/// Sequences given to the text tower at once.
const BATCH: usize = 64;

/// Progress of [`create_key`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyProgress {
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
    mut progress: impl FnMut(KeyProgress),
) -> Result<Key> {
    MessageLength::new(options.bits)?;
    if options.coded {
        // What cannot be coded is told before anything is trained.
        MessageCode::coded(options.bits, 0)?;
    }
    let bits_per_token = options.bits_per_token();
    let secret = Secret::draw(options.seed)?;
    let table = TokenTable::new(secret.expose(), options.word_bits(), bits_per_token)?;
    let length = table.positions() + 2;
    check_text_tower(clip, &identity, length)?;
    let mut encode = |sequences: &[[i64; CONTEXT]]| {
        stop.check()?;
        text_features(clip, compute, length, sequences)
    };

    let images = natural_images::features(clip, compute, pictures, options.robust_to, stop, |done| {
        progress(KeyProgress::Pictures(done, natural_images::count()));
    })?;
    let projection = fit_projection(&secret, &table, &images, clip.dim(), projection, &mut encode)?;

    // The training's seed follows from the secret, so that one seed decides the whole file.
    let training = training::TrainingOptions {
        seed: secret.derived_seed(b"guardsplat training seed v1"),
        ..options.training.clone()
    };
    let trained = train(&table, &projection, encode, &training, &compute.device, stop, |p| {
        progress(KeyProgress::Decoder(p))
    })?;
    Ok(Key {
        secret,
        seed: options.seed,
        coded_bits: options.coded.then_some(options.bits),
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
