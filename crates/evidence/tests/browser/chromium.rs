//! Chromium without a window, with a fresh profile each time, and nobody to talk to but an ear that takes notes.
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// No page takes longer, on a slow machine either.
const PATIENCE: Duration = Duration::from_secs(120);

/// What the reader's system prefers.
#[derive(Clone, Copy)]
pub enum Scheme {
    Light,
    Dark,
}

impl Scheme {
    pub fn name(self) -> &'static str {
        match self {
            Self::Light => "light",
            Self::Dark => "dark",
        }
    }
}

/// The program.
pub struct Browser {
    program: PathBuf,
}

impl Browser {
    /// The browser, or `None` (with a message) where there is none. In CI its absence is a failure.
    pub fn find() -> Option<Self> {
        let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
        let usual = || {
            let folders = std::env::var_os("PATH").unwrap_or_default();
            let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
            let all = std::env::split_paths(&folders).flat_map(|f| names.map(|name| f.join(name)));
            all.collect::<Vec<_>>().into_iter().find(|path| path.is_file())
        };
        let found = named.or_else(usual).map(|program| Self { program });
        if found.is_none() {
            let missing = "Chromium is missing; install it (Debian: chromium) or set CHROMIUM";
            assert!(std::env::var_os("CI").is_none(), "{missing}");
            eprintln!("skipped: {missing} to run this test");
        }
        found
    }

    /// The document after its scripts ran.
    pub fn dom(&self, page: &Path, scheme: Scheme) -> String {
        let (output, _) = self.run(page, scheme, &["--dump-dom".into()]);
        String::from_utf8(output).unwrap()
    }

    /// A picture of the page, and what was asked for from outside meanwhile.
    pub fn screenshot(&self, page: &Path, scheme: Scheme) -> (Vec<u8>, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        let picture = folder.path().join("page.png");
        let flags = [
            format!("--screenshot={}", picture.display()),
            "--window-size=1000,1400".into(),
        ];
        let (_, heard) = self.run(page, scheme, &flags);
        (std::fs::read(&picture).expect("a screenshot"), heard)
    }

    fn run(&self, page: &Path, scheme: Scheme, flags: &[String]) -> (Vec<u8>, Vec<String>) {
        let profile = tempfile::tempdir().unwrap();
        let output = tempfile::NamedTempFile::new().unwrap();
        let ear = TcpListener::bind("127.0.0.1:0").unwrap();
        let proxy = format!("--proxy-server=http://{}", ear.local_addr().unwrap());
        let heard = listen(ear);
        let mut browser = Command::new(&self.program)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
                "--no-first-run",
            ])
            .args([
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-sync",
            ])
            .args([
                "--disable-extensions",
                "--disable-default-apps",
                "--disable-dev-shm-usage",
                "--hide-scrollbars",
            ])
            // Whatever is asked for goes to the ear, that of this machine too.
            .args([&proxy, "--proxy-bypass-list=<-loopback>", "--virtual-time-budget=5000"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg(format!(
                "--blink-settings=preferredColorScheme={}",
                matches!(scheme, Scheme::Light) as u8
            ))
            .args(flags)
            .arg(format!("file://{}", page.display()))
            .stdin(Stdio::null())
            .stdout(output.reopen().unwrap())
            .stderr(Stdio::null())
            .spawn()
            .expect("Chromium starts");
        let start = Instant::now();
        let status = loop {
            if let Some(status) = browser.try_wait().unwrap() {
                break status;
            }
            if start.elapsed() > PATIENCE {
                browser.kill().unwrap();
                browser.wait().unwrap();
                panic!("Chromium took longer than {PATIENCE:?} for {}", page.display());
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        assert!(status.success(), "Chromium ended with {status}");
        let heard = heard.lock().unwrap();
        let heard = heard.iter().filter(|line| !is_its_own(line)).cloned().collect();
        (std::fs::read(output.path()).unwrap(), heard)
    }
}

/// Whether the browser asks for itself: the time, updates and accounts of its maker, whatever it is told.
fn is_its_own(line: &str) -> bool {
    let address = line.split(' ').nth(1).unwrap_or_default();
    let host = address
        .trim_start_matches("http://")
        .split(['/', ':'])
        .next()
        .unwrap_or_default();
    [".google.com", ".googleapis.com", ".gvt1.com"]
        .iter()
        .any(|end| host.ends_with(end))
}

/// Notes the first line of whatever is asked, and hangs up.
fn listen(ear: TcpListener) -> Arc<Mutex<Vec<String>>> {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let notes = heard.clone();
    std::thread::spawn(move || {
        for caller in ear.incoming().flatten() {
            let mut line = String::new();
            if caller.set_read_timeout(Some(Duration::from_secs(5))).is_ok() {
                let _ = BufReader::new(caller).read_line(&mut line);
            }
            notes.lock().unwrap().push(line.trim().to_owned());
        }
    });
    heard
}
