//! A PostgreSQL server for tests: a real one, with a cluster of its own in a temporary folder, reached by a socket there.
//!
//! A shell looks after it, and ends when the test process does, however that ends: its standard input is a pipe from
//! there. It then stops the server and removes the folder. Made without anything but std and what starts processes, so
//! that unit tests include this file too.
#![allow(dead_code)] // each program of tests needs a part
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::chown;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Who the server runs as where the tests run as root, which it refuses: the first of these that is there.
const USERS: [&str; 2] = ["postgres", "nobody"];
/// The database's superuser, who needs no password.
const ADMIN: &str = "guardsplat";

/// Takes `start` and `stop`, one a line, and says `ok` when that is done. `$1` has the programs, `$2` is the folder.
const KEEPER: &str = r#"
bin=$1 dir=$2
cd "$dir" || exit 1
"$bin/initdb" -D data -A trust -U guardsplat -E UTF8 --locale=C --no-sync >log 2>&1 || { cat log >&2; exit 1; }
cat >>data/postgresql.conf <<END
listen_addresses = ''
unix_socket_directories = '$dir'
fsync = off
full_page_writes = off
wal_level = minimal
max_wal_senders = 0
autovacuum = off
max_connections = 500
END
while read -r command; do
    case $command in
        start) "$bin/pg_ctl" start -w -t 60 -D data -l log >/dev/null 2>&1 || { cat log >&2; exit 1; } ;;
        stop) "$bin/pg_ctl" stop -w -t 60 -m immediate -D data >/dev/null 2>&1 ;;
    esac
    echo ok
done
"$bin/pg_ctl" stop -w -t 60 -m immediate -D data >/dev/null 2>&1
cd / && rm -rf "$dir"
"#;

/// A running server.
pub struct Cluster {
    bin: PathBuf,
    folder: PathBuf,
    keeper: Mutex<Keeper>,
}

struct Keeper {
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    _child: Child,
}

impl Cluster {
    /// Starts a server; `None` where PostgreSQL is not installed, except in CI, where that is a failure.
    pub fn start() -> Option<Self> {
        let Some(bin) = programs() else {
            assert!(
                std::env::var_os("CI").is_none(),
                "PostgreSQL is not installed, and CI is set"
            );
            eprintln!("skipped: PostgreSQL is not installed");
            return None;
        };
        let folder = tempfile::Builder::new()
            .prefix("guardsplat-pg")
            .tempdir()
            .unwrap()
            .keep();
        let mut command = Command::new("sh");
        command
            .args(["-c", KEEPER, "keeper"])
            .arg(&bin)
            .arg(&folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            // Ctrl-C at a terminal is for the tests; this ends after them.
            .process_group(0);
        if nix::unistd::geteuid().is_root() {
            let found = USERS.iter().find_map(|name| nix::unistd::User::from_name(name).ok()?);
            let user = found.expect("a user who is not root, for PostgreSQL");
            chown(&folder, Some(user.uid.as_raw()), Some(user.gid.as_raw())).unwrap();
            command.uid(user.uid.as_raw()).gid(user.gid.as_raw());
        }
        let mut child = command.spawn().unwrap();
        let keeper = Keeper {
            input: child.stdin.take().unwrap(),
            output: BufReader::new(child.stdout.take().unwrap()),
            _child: child,
        };
        let cluster = Self {
            bin,
            folder,
            keeper: Mutex::new(keeper),
        };
        cluster.resume();
        Some(cluster)
    }

    /// The server that all tests of this process share.
    pub fn shared() -> Option<&'static Self> {
        static SHARED: OnceLock<Option<Cluster>> = OnceLock::new();
        SHARED.get_or_init(Self::start).as_ref()
    }

    /// Stops the server without warning; what it acknowledged is kept.
    pub fn stop(&self) {
        self.tell("stop");
    }

    /// Starts it again.
    pub fn resume(&self) {
        self.tell("start");
    }

    fn tell(&self, command: &str) {
        let mut keeper = self.keeper.lock().unwrap_or_else(PoisonError::into_inner);
        writeln!(keeper.input, "{command}").unwrap();
        let mut answer = String::new();
        keeper.output.read_line(&mut answer).unwrap();
        assert_eq!(answer.trim(), "ok", "PostgreSQL did not {command}");
    }

    /// Makes an empty database, or a copy of one that nobody uses.
    pub fn create(&self, name: &str, template: Option<&str>) {
        let template = template.map(|of| ["-T", of]);
        self.run("createdb", template.iter().flatten().copied().chain([name]));
    }

    /// Removes a database, whoever uses it.
    pub fn remove(&self, name: &str) {
        self.run("dropdb", ["--force", name]);
    }

    fn run<'a>(&self, program: &str, arguments: impl IntoIterator<Item = &'a str>) {
        let done = Command::new(self.bin.join(program))
            .args(["-U", ADMIN, "-h"])
            .arg(&self.folder)
            .args(arguments)
            .output()
            .unwrap();
        assert!(
            done.status.success(),
            "{program}: {}",
            String::from_utf8_lossy(&done.stderr)
        );
    }

    /// Where a database is.
    pub fn url(&self, name: &str) -> String {
        format!("postgres:///{name}?host={}&user={ADMIN}", self.folder.display())
    }
}

/// The folder of `initdb` and the others: on the search path, or where Debian and others have them.
fn programs() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_else(|| OsString::from("/usr/bin"));
    let mut folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let mut versions: Vec<PathBuf> = std::fs::read_dir("/usr/lib/postgresql")
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path().join("bin"))
        .collect();
    // The newest last, and tried first.
    versions.sort_by_key(|folder| version(folder));
    folders.extend(versions.into_iter().rev());
    folders.push("/usr/local/pgsql/bin".into());
    // Links lead to the folder that has all of them.
    let found = folders
        .iter()
        .find_map(|folder| folder.join("initdb").canonicalize().ok())?;
    found.parent().map(Path::to_owned)
}

fn version(bin: &Path) -> u32 {
    let name = bin.parent().and_then(Path::file_name).and_then(|name| name.to_str());
    name.and_then(|name| name.parse().ok()).unwrap_or(0)
}
