//! `run`.
use std::path::PathBuf;

use clap::Args;
use guardsplat_worker::device::DeviceChoice;

use super::{Budget, Exit};
use crate::jobs;

#[derive(Args)]
pub struct Arguments {
    /// Address of the server, such as http://127.0.0.1:50051
    #[arg(long, value_name = "URL")]
    server: String,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    #[command(flatten)]
    budget: Budget,
    /// What the worker calls itself; the machine's name and the process's number unless given
    #[arg(long)]
    name: Option<String>,
    /// Leaves, as on SIGTERM, when standard input ends
    #[arg(long)]
    stop_with_stdin: bool,
    /// A folder for the files of jobs under way; the system's for temporary files unless given
    #[arg(long, value_name = "DIR")]
    work_dir: Option<PathBuf>,
}

pub fn run(arguments: Arguments) -> Exit {
    let options = jobs::Options {
        server: arguments.server,
        device: arguments.device,
        memory: arguments.budget.bytes(),
        name: arguments.name,
        stop_with_stdin: arguments.stop_with_stdin,
        work_dir: arguments.work_dir,
    };
    match jobs::run(&options) {
        Ok(()) => Exit::Done,
        Err(error) => {
            eprintln!("error: {error}");
            Exit::Failed
        }
    }
}
