//! Tensor names: a module's field path is the tensor's name in OpenCLIP's checkpoints, and Hugging Face's follow from it.

/// Follows burn's walk through a module and tells the OpenCLIP name of the parameter it stands at.
#[derive(Default)]
pub(super) struct Walk {
    path: Vec<Option<String>>,
    container: Vec<String>,
}

impl Walk {
    /// For `enter_module` of visitors and mappers.
    pub fn enter(&mut self, name: &str, container: &str) {
        let name = match (container, name) {
            (c, _) if c.starts_with("Enum:") => None,
            // The text tower's tensors stand at the top level.
            ("Struct:ClipModel", "text") => None,
            ("Struct:BatchNorm" | "Struct:LayerNorm", "gamma") => Some("weight"),
            ("Struct:BatchNorm" | "Struct:LayerNorm", "beta") => Some("bias"),
            (_, name) => Some(name),
        };
        self.path.push(name.map(str::to_owned));
        self.container.push(container.to_owned());
    }

    /// For `exit_module`.
    pub fn exit(&mut self) {
        self.path.pop();
        self.container.pop();
    }

    /// The name, as `visual.layer1.0.bn1.weight`.
    pub fn name(&self) -> String {
        self.path
            .iter()
            .flatten()
            .map(String::as_str)
            .collect::<Vec<_>>()
            .join(".")
    }

    /// Whether checkpoints hold the transpose: torch's linear maps are `[out, in]`, burn's `[in, out]`.
    pub fn transposed(&self) -> bool {
        let field = self.path.last().and_then(Option::as_deref);
        match field {
            Some("weight") => self.container.last().is_some_and(|c| c == "Struct:Linear"),
            Some("in_proj_weight") => true,
            _ => false,
        }
    }

    /// Whether the parameter is the scale of a normalisation.
    pub fn is_norm(&self) -> bool {
        self.container
            .last()
            .is_some_and(|c| c == "Struct:BatchNorm" || c == "Struct:LayerNorm")
    }
}

/// Where a tensor with an OpenCLIP name is found in a Hugging Face checkpoint: several tensors are stacked along
/// the first axis (query, key, value); `transposed` is for projections, which are plain matrices in OpenCLIP.
pub(super) struct Stored {
    /// Names in the checkpoint.
    pub names: Vec<String>,
    /// Whether the checkpoint holds the transpose.
    pub transposed: bool,
}

/// The Hugging Face tensors that make up the OpenCLIP tensor `name`.
pub(super) fn hugging_face(name: &str) -> Stored {
    let (model, rest) = match name.strip_prefix("visual.") {
        Some(rest) => ("vision_model", rest),
        None => ("text_model", name),
    };
    let one = |name: String| Stored {
        names: vec![name],
        transposed: false,
    };
    let projection = |name: &str| Stored {
        names: vec![name.to_owned()],
        transposed: true,
    };
    if let Some((layer, part)) = rest
        .strip_prefix("transformer.resblocks.")
        .and_then(|r| r.split_once('.'))
    {
        let prefix = format!("{model}.encoder.layers.{layer}");
        if let Some(kind) = part.strip_prefix("attn.in_proj_") {
            let names = ["q", "k", "v"].map(|p| format!("{prefix}.self_attn.{p}_proj.{kind}"));
            return Stored {
                names: names.into(),
                transposed: false,
            };
        }
        let part = part
            .replace("attn.out_proj", "self_attn.out_proj")
            .replace("ln_", "layer_norm")
            .replace("c_fc", "fc1")
            .replace("c_proj", "fc2");
        return one(format!("{prefix}.{part}"));
    }
    match (model, rest) {
        ("vision_model", "class_embedding") => one(format!("{model}.embeddings.class_embedding")),
        ("vision_model", "conv1.weight") => one(format!("{model}.embeddings.patch_embedding.weight")),
        ("vision_model", "proj") => projection("visual_projection.weight"),
        (_, "text_projection") => projection("text_projection.weight"),
        (_, "positional_embedding") => one(format!("{model}.embeddings.position_embedding.weight")),
        (_, "token_embedding.weight") => one(format!("{model}.embeddings.token_embedding.weight")),
        (_, "logit_scale") => one(rest.to_owned()),
        _ => one(match rest.rsplit_once('.') {
            // The misspelling is in every published checkpoint.
            Some(("ln_pre", kind)) => format!("{model}.pre_layrnorm.{kind}"),
            Some(("ln_post", kind)) => format!("{model}.post_layernorm.{kind}"),
            Some(("ln_final", kind)) => format!("{model}.final_layer_norm.{kind}"),
            // ResNet towers do not exist in this form; the name is then reported as missing.
            _ => format!("{model}.{rest}"),
        }),
    }
}

/// Whether a checkpoint with these names is in Hugging Face's form.
pub(super) fn is_hugging_face<'a>(mut names: impl Iterator<Item = &'a str>) -> bool {
    names.any(|n| n.starts_with("vision_model.") || n.starts_with("text_model."))
}

/// Whether the stored tensor, in either form, belongs to the image tower (else to the text tower or both).
pub(super) fn is_visual(stored: &str) -> bool {
    stored.starts_with("visual.") || stored.starts_with("vision_model.") || stored == "visual_projection.weight"
}

/// Tensors that checkpoints carry and nobody needs: position numbers, masks, counters, sizes.
pub(super) fn is_ignored(stored: &str) -> bool {
    let last = stored.rsplit('.').next().unwrap_or(stored);
    ["position_ids", "attn_mask", "num_batches_tracked"].contains(&last)
        || ["input_resolution", "context_length", "vocab_size"].contains(&stored)
}
