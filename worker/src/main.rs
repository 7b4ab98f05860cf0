//! `guardsplat-worker`: marks Gaussian Splatting scenes and reads marks back, on one machine.
mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
