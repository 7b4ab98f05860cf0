//! `sign`: the manifest of a marked scene, signed, as a sidecar.
use std::io::Write as _;
use std::path::{Path, PathBuf};

use c2pa::assertions::{Action, SoftBinding, SoftBindingBlock, SoftBindingScope, c2pa_action};
use c2pa::{Builder, ClaimGeneratorInfo, Context, Ingredient};
use clap::Args;
use guardsplat_soft_binding::{ALGORITHM, Value};

use crate::error::{Error, Result};
use crate::signer::Certificate;
use crate::{print_line, scene_file};

/// What was done to the scene, as the C2PA's specification (2.2, table of actions) calls it: a mark was put in that a soft
/// binding names.
const WATERMARKED: &str = "c2pa.watermarked.bound";

/// What the original is called inside the manifest.
const ORIGINAL: &str = "original";

/// Arguments of `sign`.
#[derive(Args)]
pub struct Arguments {
    /// The scene as it was before it was marked
    #[arg(value_name = "ORIGINAL")]
    original: PathBuf,
    /// The marked scene
    #[arg(value_name = "MARKED")]
    marked: PathBuf,
    /// Where to write the credentials (.c2pa)
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// What names the mark, as `guardsplat-worker` makes it
    #[arg(long, value_name = "BASE64")]
    soft_binding: String,
    #[command(flatten)]
    certificate: Certificate,
}

/// Writes the sidecar, and says who signed.
pub fn run(arguments: &Arguments) -> Result<()> {
    let value = Value::parse(&arguments.soft_binding)?;
    let (signer, test) = arguments.certificate.signer()?;
    let mut builder = Builder::from_context(Context::new().with_signer(signer));
    describe(&mut builder, arguments, &value)?;
    let mut marked = scene_file::open(&arguments.marked)?;
    builder
        .update_hash_from_stream(scene_file::MEDIA_TYPE, &mut marked)
        .map_err(Error::Manifest)?;
    let manifest = builder
        .sign_embeddable("application/c2pa")
        .map_err(|source| arguments.certificate.failed(source))?;
    write(&arguments.output, &manifest)?;
    print_line(&format!(
        "credentials written to {}{}",
        arguments.output.display(),
        if test {
            ", signed with a test certificate that nobody trusts"
        } else {
            ""
        }
    ));
    Ok(())
}

/// What the manifest says, but for the hash of the marked scene.
fn describe(builder: &mut Builder, arguments: &Arguments, value: &Value) -> Result<()> {
    let mut generator = ClaimGeneratorInfo::new("GuardSplat");
    generator.set_version(env!("CARGO_PKG_VERSION"));
    builder.set_claim_generator_info(generator);
    builder.set_format(scene_file::MEDIA_TYPE);
    builder.definition.title = Some(scene_file::title(&arguments.marked));
    builder.definition.instance_id = scene_file::name_by_hash(&arguments.marked)?;

    // An ingredient without credentials of its own: its name and its hash.
    let mut original = Ingredient::new(
        scene_file::title(&arguments.original),
        scene_file::MEDIA_TYPE.to_owned(),
        scene_file::name_by_hash(&arguments.original)?,
    );
    original.set_is_parent().set_label(ORIGINAL);
    builder.add_ingredient(original);

    let opened = Action::new(c2pa_action::OPENED).set_parameter("ingredientIds", [ORIGINAL]);
    builder
        .add_action(opened.map_err(Error::Manifest)?)
        .and_then(|builder| builder.add_action(Action::new(WATERMARKED)))
        .and_then(|builder| builder.add_assertion(SoftBinding::LABEL, &soft_binding(value)))
        .map_err(Error::Manifest)?;
    Ok(())
}

/// The mark is in all of the scene, so that the scope says nothing.
fn soft_binding(value: &Value) -> SoftBinding {
    let mut binding = SoftBinding::default();
    binding.alg = Some(ALGORITHM.into());
    binding.blocks = vec![SoftBindingBlock {
        scope: SoftBindingScope::default(),
        value: value.text(),
    }];
    binding
}

/// Whole or not at all; others may read it, as it is to be handed out.
fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut file = tempfile::Builder::new()
        .permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644))
        .tempfile_in(folder.unwrap_or(Path::new(".")))
        .map_err(Error::io(path))?;
    file.write_all(bytes).map_err(Error::io(path))?;
    file.persist(path).map_err(|error| Error::io(path)(error.error))?;
    Ok(())
}
