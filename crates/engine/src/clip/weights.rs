//! Moves weights between a [`ClipModel`] and checkpoints with Hugging Face or OpenCLIP names.
use super::config::ClipConfig;
use super::model::{ClipModel, Parts};
use super::names::{Stored, Walk, hugging_face, is_hugging_face, is_ignored, is_visual};
use super::tensor_file::TensorSource;
use crate::error::{Error, Result};
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor, TensorData};
use half::f16;
use safetensors::{Dtype, tensor::TensorView};
use std::collections::HashMap;
use std::path::Path;

/// How many tensors an error message names.
const NAMED: usize = 3;

impl ClipModel {
    /// Gives every parameter its value from `source`.
    ///
    /// # Errors
    /// [`Error::BadModel`] naming tensors that are missing, have another shape (expected and found), or belong to
    /// no parameter, before anything is read; also when a value is not finite or a tensor is not of a float type.
    pub fn load(self, source: &mut dyn TensorSource) -> Result<Self> {
        let mut plan = Plan::new(self.visual.is_some(), self.text.is_some(), source);
        self.visit(&mut plan);
        let layout = plan.finish(source.name())?;
        let mut loader = Loader {
            walk: Walk::default(),
            layout,
            source,
            failed: None,
        };
        let model = self.map(&mut loader);
        loader.failed.map_or(Ok(model), Err)
    }
}

impl ClipModel {
    /// Checks that the tensors of `source` are those of a whole model with this configuration, reading none of them.
    ///
    /// # Errors
    /// [`Error::BadModel`] as for [`ClipModel::load`].
    pub fn check(config: &ClipConfig, source: &dyn TensorSource) -> Result<()> {
        let mut plan = Plan::new(true, true, source);
        ClipModel::new(config, Parts::Both, &Device::flex()).visit(&mut plan);
        plan.finish(source.name()).map(|_| ())
    }
}

/// Whether a checkpoint names its tensors as Hugging Face does or as OpenCLIP does.
#[derive(Clone, Copy)]
enum Layout {
    HuggingFace,
    OpenClip,
}

impl Layout {
    fn stored(self, name: String) -> Stored {
        match self {
            Self::HuggingFace => hugging_face(&name),
            Self::OpenClip => Stored {
                names: vec![name],
                transposed: false,
            },
        }
    }
}

/// First walk: compares what the model needs with what the checkpoint has.
struct Plan {
    walk: Walk,
    layout: Layout,
    /// Tensors no parameter has asked for yet.
    unused: HashMap<String, Vec<usize>>,
    problems: Vec<String>,
}

impl Plan {
    fn new(visual: bool, text: bool, source: &dyn TensorSource) -> Self {
        let tensors = source.tensors();
        let layout = match is_hugging_face(tensors.iter().map(|(name, _)| name.as_str())) {
            true => Layout::HuggingFace,
            false => Layout::OpenClip,
        };
        let wanted = |name: &str| {
            !is_ignored(name)
                && (if is_visual(name) {
                    visual
                } else {
                    text || name == "logit_scale"
                })
        };
        let unused = tensors.into_iter().filter(|(name, _)| wanted(name)).collect();
        Self {
            walk: Walk::default(),
            layout,
            unused,
            problems: Vec::new(),
        }
    }

    /// The layout, when everything fits.
    fn finish(mut self, name: &str) -> Result<Layout> {
        let mut extra: Vec<_> = self.unused.into_iter().collect();
        extra.sort();
        self.problems.extend(
            extra
                .into_iter()
                .map(|(name, shape)| format!("tensor {name} {shape:?} is not expected")),
        );
        let more = self.problems.len().saturating_sub(NAMED);
        self.problems.truncate(NAMED);
        let mut reason = self.problems.join("; ");
        if more > 0 {
            reason += &format!("; and {more} more tensors");
        }
        if reason.is_empty() {
            Ok(self.layout)
        } else {
            Err(Error::BadModel {
                name: name.to_owned(),
                reason,
            })
        }
    }
}

impl ModuleVisitor for Plan {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.walk.enter(name, container);
    }
    fn exit_module(&mut self, _: &str, _: &str) {
        self.walk.exit();
    }
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let stored = self.layout.stored(self.walk.name());
        let mut expected = param.lazy_shape().to_vec();
        if stored.transposed != self.walk.transposed() {
            expected.reverse();
        }
        if D >= 1 && stored.names.len() > 1 {
            expected[0] /= stored.names.len();
        }
        for name in stored.names {
            match self.unused.remove(&name) {
                None => self
                    .problems
                    .push(format!("tensor {name} is missing, expected {expected:?}")),
                // Scalars are stored without axes.
                Some(found) if found.is_empty() && expected == [1] => {}
                Some(found) if found == expected => {}
                Some(found) => {
                    self.problems
                        .push(format!("tensor {name} has shape {found:?}, expected {expected:?}"));
                }
            }
        }
    }
}

/// Second walk: reads each tensor where it is needed.
struct Loader<'a> {
    walk: Walk,
    layout: Layout,
    source: &'a mut dyn TensorSource,
    failed: Option<Error>,
}

impl ModuleMapper for Loader<'_> {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.walk.enter(name, container);
    }
    fn exit_module(&mut self, _: &str, _: &str) {
        self.walk.exit();
    }
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        if self.failed.is_some() {
            return param;
        }
        let Stored { names, transposed } = self.layout.stored(self.walk.name());
        let mut values = Vec::new();
        for name in names {
            match self.source.read(&name) {
                Ok(part) if values.is_empty() => values = part,
                Ok(part) => values.extend(part),
                Err(error) => {
                    self.failed = Some(error);
                    return param;
                }
            }
        }
        let shape = param.lazy_shape().to_vec();
        if transposed != self.walk.transposed() {
            values = transpose(&values, shape[1], shape[0]);
        }
        set(param, values)
    }
}

/// The parameter with `values` in its own shape, on its device, tracked as before.
pub(super) fn set<const D: usize>(param: Param<Tensor<D>>, values: Vec<f32>) -> Param<Tensor<D>> {
    let data = TensorData::new(values, param.lazy_shape());
    let (id, device) = (param.id, param.lazy_device());
    param.transform_for_load(Tensor::from_data(data, &device), id)
}

/// The transpose of a row-major matrix.
fn transpose(values: &[f32], rows: usize, columns: usize) -> Vec<f32> {
    (0..columns)
        .flat_map(|c| (0..rows).map(move |r| values[r * columns + c]))
        .collect()
}

/// Number format of saved matrices; vectors (biases, norms, running averages) are always f32, they are few.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit floats.
    F16,
    /// 32-bit floats.
    F32,
}

impl ClipModel {
    /// Writes the model to `path` as safetensors with OpenCLIP names, whole or not at all.
    ///
    /// # Errors
    /// [`Error::BadModel`] when a weight is not finite in that precision, [`Error::Io`] when it cannot be written.
    pub fn save(&self, path: &Path, precision: Precision) -> Result<()> {
        let mut saver = Saver {
            walk: Walk::default(),
            precision,
            tensors: Vec::new(),
        };
        // The validation copy has the running averages of the last step, too.
        self.valid().visit(&mut saver);
        let bad = |reason: String| Error::BadModel {
            name: path.display().to_string(),
            reason,
        };
        let mut views = Vec::with_capacity(saver.tensors.len());
        for tensor in &saver.tensors {
            if !tensor.finite {
                return Err(bad(format!(
                    "tensor {} is not finite as {:?}",
                    tensor.name, tensor.dtype
                )));
            }
            let view = TensorView::new(tensor.dtype, tensor.shape.clone(), &tensor.bytes);
            views.push((tensor.name.as_str(), view.map_err(|e| bad(e.to_string()))?));
        }
        let bytes = safetensors::serialize(views, None).map_err(|e| bad(e.to_string()))?;
        write_whole(path, &bytes)
    }
}

/// Writes a file under a temporary name and renames it.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let dir = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(dir).map_err(Error::io(path))?;
    std::io::Write::write_all(&mut file, bytes).map_err(Error::io(path))?;
    file.as_file().sync_all().map_err(Error::io(path))?;
    file.persist(path).map_err(|e| Error::io(path)(e.error))?;
    Ok(())
}

struct Saver {
    walk: Walk,
    precision: Precision,
    tensors: Vec<Saved>,
}

struct Saved {
    name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
    finite: bool,
}

impl ModuleVisitor for Saver {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.walk.enter(name, container);
    }
    fn exit_module(&mut self, _: &str, _: &str) {
        self.walk.exit();
    }
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let name = self.walk.name();
        let mut shape = param.lazy_shape().to_vec();
        let mut values: Vec<f32> = param.val().into_data().iter::<f32>().collect();
        if self.walk.transposed() {
            values = transpose(&values, shape[0], shape[1]);
            shape.reverse();
        }
        if name == "logit_scale" {
            shape.clear();
        }
        let (dtype, bytes, finite) = if self.precision == Precision::F16 && D > 1 {
            let halves: Vec<f16> = values.iter().map(|v| f16::from_f32(*v)).collect();
            let finite = halves.iter().all(|v| v.is_finite());
            (
                Dtype::F16,
                halves.iter().flat_map(|v| v.to_le_bytes()).collect(),
                finite,
            )
        } else {
            let finite = values.iter().all(|v| v.is_finite());
            (
                Dtype::F32,
                values.iter().flat_map(|v| v.to_le_bytes()).collect(),
                finite,
            )
        };
        self.tensors.push(Saved {
            name,
            dtype,
            shape,
            bytes,
            finite,
        });
    }
}
