//! The command line: what there is to say.
use clap::{ArgMatches, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::commands;
use crate::options::Global;

/// Marks 3D Gaussian Splatting scenes with a message and reads it back, through a GuardSplat server.
///
/// Exit codes: 0 done or match, 1 error, 2 no match, 3 inconclusive or target missed.
#[derive(Parser)]
#[command(name = "guardsplat", version, after_long_help = EXAMPLE)]
pub struct Arguments {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

impl Arguments {
    /// What was typed, and the name of its command: `jobs watch`.
    pub fn read() -> clap::error::Result<(Self, String)> {
        let matches = Self::command().try_get_matches()?;
        let name = command_name(&matches);
        Ok((Self::from_arg_matches(&matches)?, name))
    }
}

/// The command and those below it, which are words of this program.
fn command_name(matches: &ArgMatches) -> String {
    let below = std::iter::successors(matches.subcommand(), |(_, matches)| matches.subcommand());
    let names: Vec<&str> = below.map(|(name, _)| name).collect();
    names.join(" ")
}

const EXAMPLE: &str = "\
From nothing to a verdict:
  guardsplat key create --bits 64 --display-name website
  guardsplat owner create studio
  guardsplat asset create scene.ply --owner studio --key website
  guardsplat embed scene.ply -o marked.ply --key website --asset assets/ID
  guardsplat verify suspect.ply --key website --search

The configuration file may set `server`, `timeout`, `ca`, `cert`, `cert_key` and `token_file`; flags and variables
(GUARDSPLAT_SERVER, GUARDSPLAT_CA and so on) go before it. A token is taken from GUARDSPLAT_TOKEN or a file, and is never
an argument, which everybody on the machine could see.";

/// The commands.
#[derive(Subcommand)]
pub enum Command {
    // A doc comment would not be allowed here: each of them has its own.
    #[command(flatten)]
    Server(Box<commands::Command>),
    #[command(flatten)]
    Packaging(guardsplat_packaging::Command),
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn parse(line: &str) -> Result<Arguments, clap::Error> {
        Arguments::try_parse_from(std::iter::once("guardsplat").chain(line.split(' ')))
    }

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn the_promised_commands_parse() {
        for line in [
            "key create --bits 32 --seed 7 --display-name T",
            "key list --json",
            "--json --server http://h:1 --config F --timeout 5 embed IN -o OUT --key K --message c0ffee42",
            "embed IN -o OUT --key K --message 0 --preset draft --seed 1 --size 128 --force --comparison C --ignore-bad-rows --json",
            "embed IN --key K --message 0 --no-wait --request-id 5f0c54a6-6b0d-4d6f-9a80-6a7a0b1f4f11",
            "embed IN -o OUT --key K --message 0 --cancel-on-interrupt",
            "verify A B C --key K --message 0 --views 5 --size 64 --seed 3 --ignore-bad-rows",
            "embed IN -o OUT --key K --asset A",
            "verify A --key K --asset A --json",
            "verify A --key K --owner O",
            "verify A --key K --search",
            "owner create N",
            "owner list",
            "owner show O",
            "asset create F --owner O --key K --display-name N",
            "asset list --owner O --key K --limit 3",
            "asset show A",
            "commitment export A -o F",
            "commitment reveal commitments/C -o F --json",
            "commitment check F --report R --public-key P",
            "token create --scope embed --scope verify --expires 90d --display-name N",
            "token list --json",
            "token revoke T",
            "hook create https://h/x --kind embed --kind verify --state succeeded --display-name N",
            "hook list --json",
            "hook delete H",
            "hook deliveries --hook H --state dead --limit 7",
            "hook redeliver D",
            "hook listen --listen 127.0.0.1:0 --secret-file F --folder D -- ./publish.sh a -b",
            "hook s3 --store-token-file F --bucket B --folder D --key K --message 0 --preset draft",
            "hook s3 --bucket B --folder D --key K -- ./message.sh",
            "hook s3 --bucket B --prefix http://store:9000/b/ --key K --message 0",
            "report open J -o F",
            "report check F --public-key P",
            "report key",
            "jobs list --state queued --state running --limit 5",
            "jobs get J",
            "jobs watch J --cursor C",
            "jobs cancel J",
            "jobs dead --reason target-missed --reason internal --limit 5",
            "jobs attempts J --json",
            "jobs requeue J",
            "worker list --json",
            "embed IN -o OUT --key K --message 0 --credentials OUT.c2pa",
            "verify A --key K --search --credentials A.c2pa",
            "artifact put F",
            "artifact get A -o F",
            "artifact delete A",
            "completions bash",
            "manual DIR",
        ] {
            assert!(parse(line).is_ok(), "{line}");
        }
    }

    #[test]
    fn a_command_is_called_by_its_words_alone() {
        for (line, name) in [
            ("jobs watch J --cursor C", "jobs watch"),
            ("embed IN -o O --key K --message 0", "embed"),
            ("--server http://h:1 token list", "token list"),
        ] {
            let line = std::iter::once("guardsplat").chain(line.split_whitespace());
            let matches = Arguments::command().try_get_matches_from(line).unwrap();
            assert_eq!(command_name(&matches), name);
        }
    }

    #[test]
    fn wrong_usage_is_told() {
        let wrong = |line: &str| parse(line).err().unwrap().to_string();
        assert!(wrong("embed IN --key K --message 0").contains("--output"));
        assert!(wrong("verify --key K").contains("PATH"));
        assert!(wrong("embed IN -o O --key K").contains("--asset"));
        assert!(wrong("embed IN -o O --key K --asset A --message 0").contains("--message"));
        for two in [
            "--asset A --owner O",
            "--owner O --search",
            "--search --message 0",
            "--asset A --message 0",
        ] {
            assert!(
                wrong(&format!("verify S --key K {two}")).contains("cannot be used"),
                "{two}"
            );
        }
        assert!(wrong("hook s3 --bucket B --folder D --key K").contains("--message"));
        assert!(wrong("hook s3 --bucket B --key K --message 0").contains("--folder"));
        assert!(wrong("hook s3 --bucket B --prefix h --key K --message 0").contains("--prefix"));
        assert!(wrong("hook s3 --bucket B --folder D --key K --message 0 -- ./m.sh").contains("cannot be used"));
        assert!(wrong("token create").contains("--scope"));
        assert!(wrong("token create --scope worker").contains("guardsplat-server token create"));
        assert!(wrong("token create --scope embed --expires soon").contains("--expires"));
        assert!(wrong("verify A --key K --views 0").contains("1..=10000"));
        assert!(wrong("key create --bits 151").contains("1..=150"));
        assert!(wrong("embed IN -o O --key K --message 0 --size 8").contains("16..=4096"));
        let long = format!("key create --bits 8 --display-name {}", "é".repeat(64));
        assert!(wrong(&long).contains("64 characters, at most 63"));
        assert!(parse(&long.replacen('é', "", 1)).is_ok());
        assert!(wrong("key list --timeout 0").contains("--timeout"));
        assert!(wrong("key create --bits 8 --priority 11").contains("-10..=10"));
        assert!(parse("key create --bits 8 --priority -10").is_ok());
        assert!(wrong("embed IN -o O --key K --message 0 --request-id 7").contains("--request-id"));
    }
}
