//! CLIP's text tower: a causal transformer whose feature is taken at the end token.
use super::config::{EndToken, TextConfig};
use super::layer_norm::LayerNorm;
use super::params::param;
use super::transformer::{Transformer, layer_norm};
use burn::module::{Module, Param};
use burn::tensor::{Device, Int, IntDType, Tensor};

/// The text tower. Fields are named as in OpenCLIP's checkpoints.
#[derive(Module, Debug)]
pub struct TextTransformer {
    token_embedding: TokenEmbedding,
    positional_embedding: Param<Tensor<2>>,
    transformer: Transformer,
    ln_final: LayerNorm,
    text_projection: Param<Tensor<2>>,
    #[module(skip)]
    end: EndToken,
}

#[derive(Module, Debug)]
struct TokenEmbedding {
    /// `[vocab_size, width]`
    weight: Param<Tensor<2>>,
}

impl TextTransformer {
    /// Lays out the tower; `embed_dim` is the width of its features.
    pub fn new(text: &TextConfig, embed_dim: usize, device: &Device) -> Self {
        let width = text.width;
        Self {
            token_embedding: TokenEmbedding {
                weight: param([text.vocab_size, width], device),
            },
            positional_embedding: param([text.context_length, width], device),
            transformer: Transformer::new(width, &text.blocks, device),
            ln_final: layer_norm(width, &text.blocks, device),
            text_projection: param([width, embed_dim], device),
            end: text.end,
        }
    }

    /// The embedding of every token, `[vocab_size, width]`.
    pub fn token_embedding(&self) -> Tensor<2> {
        self.token_embedding.weight.val()
    }

    /// Features `[batch, embed_dim]` of token ids `[batch, n]`, each below `vocab_size`, `n` at most `context_length`.
    ///
    /// Nothing after the end token changes a feature, so sequences may be cut after the last end token.
    pub fn forward(&self, tokens: Tensor<2, Int>) -> Tensor<2> {
        let [batch, length] = tokens.dims();
        // Integers come in the width of whoever made them, and devices do not mix widths.
        let tokens = tokens.cast(IntDType::I32);
        let ends = end_positions(tokens.clone(), self.end);
        let weight = self.token_embedding.weight.val();
        let width = weight.dims()[1];
        let embedded = weight
            .select(0, tokens.reshape([batch * length]))
            .reshape([batch, length, width]);
        let positions = self.positional_embedding.val().narrow(0, 0, length);
        let x = self.transformer.forward(embedded + positions.unsqueeze(), true);
        let rows = ends + counting(batch, &x.device()).mul_scalar(length as i64);
        let x = x.reshape([batch * length, width]).select(0, rows);
        self.ln_final.forward(x).matmul(self.text_projection.val())
    }
}

/// The position of each sequence's end token, `[batch]`: the *first* when several qualify.
fn end_positions(tokens: Tensor<2, Int>, end: EndToken) -> Tensor<1, Int> {
    let [batch, length] = tokens.dims();
    let score = match end {
        EndToken::Largest => tokens,
        EndToken::Id(id) => tokens.equal_elem(id as i64).int(),
    };
    // Backends differ in which of equal values is the largest, so earlier positions are made larger.
    let device = score.device();
    let earlier = counting(length, &device).mul_scalar(-1).add_scalar(length as i64 - 1);
    let score = score.cast(IntDType::I32).mul_scalar(length as i64) + earlier.unsqueeze();
    score.argmax(1).reshape([batch]).cast(IntDType::I32)
}

/// 0 to `n - 1`.
fn counting(n: usize, device: &Device) -> Tensor<1, Int> {
    Tensor::arange(0..n as i64, device).cast(IntDType::I32)
}
