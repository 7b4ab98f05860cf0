//! `guardsplat-worker`: marks Gaussian Splatting scenes and reads marks back, on one machine or for a server.
mod cli;
mod credentials_program;
mod error;
mod evaluate;
mod jobs;
mod machine;

fn main() -> std::process::ExitCode {
    guardsplat_engine::memory::keep_freed();
    cli::run()
}
