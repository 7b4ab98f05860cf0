//! URLs that may be registered. Names are looked up when something is sent, and their addresses checked then.
use url::{Host, Url};

use super::Rules;
use super::address::{Reach, reach};

/// Longest URL, in characters.
const LONGEST: usize = 2000;

/// The URL, if messages may be sent to it as far as it tells itself.
///
/// # Errors
/// What is wrong with it, in words that no part of it is in.
pub fn check_url(rules: &Rules, text: &str) -> Result<Url, String> {
    if text.is_empty() {
        return Err("is missing".into());
    }
    let length = text.chars().count();
    if length > LONGEST {
        return Err(format!("has {length} characters, at most {LONGEST} are taken"));
    }
    // The parser would leave such characters out.
    if text.contains(|c: char| c.is_control() || c.is_whitespace()) {
        return Err("has a space or a control character in it".into());
    }
    let url = Url::parse(text).map_err(|error| format!("is no URL: {error}"))?;
    match url.scheme() {
        "https" => {}
        "http" if rules.allow_http => {}
        "http" => return Err("must be of https; this server does not allow http (hook_allow_http)".into()),
        _ => return Err("must be of https".into()),
    }
    if !url.username().is_empty() || url.password().is_some() {
        return Err("must not have a user or a password".into());
    }
    if url.fragment().is_some() {
        return Err("must not have a fragment".into());
    }
    let literal = match url.host() {
        Some(Host::Ipv4(address)) => Some(address.into()),
        Some(Host::Ipv6(address)) => Some(address.into()),
        Some(Host::Domain(_)) => None,
        None => return Err("has no host".into()),
    };
    match literal.map(reach) {
        Some(Reach::Never) => Err("has an address that nobody can be at".into()),
        Some(Reach::Private) if !rules.allow_private => {
            Err("has an address that is not public, which this server does not allow (hook_allow_private)".into())
        }
        _ => Ok(url),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(rules: &Rules, text: &str) -> String {
        check_url(rules, text).expect_err(text)
    }

    #[test]
    fn what_can_not_be_called_is_refused_with_the_reason() {
        let strict = Rules::default();
        for good in [
            "https://shop.example/hook?a=b",
            "https://shop.example:8443/",
            "https://8.8.8.8/x",
            "https://[2606:4700:4700::1111]/",
        ] {
            check_url(&strict, good).unwrap();
        }
        for (text, reason) in [
            ("", "missing"),
            ("shop.example", "no URL"),
            ("http://shop.example/", "hook_allow_http"),
            ("ftp://shop.example/", "must be of https"),
            ("file:///etc/passwd", "must be of https"),
            ("https://", "no URL"),
            ("https://user@shop.example/", "user or a password"),
            ("https://:5ec2e7@shop.example/", "user or a password"),
            ("https://shop.example/#a", "fragment"),
            ("https://shop.example/\n", "control character"),
            ("https://sh\top.example/", "control character"),
            ("https://127.0.0.1/", "hook_allow_private"),
            ("https://2130706433/", "hook_allow_private"),
            ("https://0x7f.1/", "hook_allow_private"),
            ("https://0177.0.0.1/", "hook_allow_private"),
            ("https://[::1]/", "hook_allow_private"),
            ("https://[::ffff:10.0.0.1]/", "hook_allow_private"),
            ("https://169.254.169.254/latest", "hook_allow_private"),
            ("https://0.0.0.0/", "nobody"),
            ("https://[::]/", "nobody"),
            ("https://255.255.255.255/", "nobody"),
        ] {
            let told = refused(&strict, text);
            assert!(told.contains(reason) && !told.contains("5ec2e7"), "{text}: {told}");
        }
        let long = format!("https://shop.example/{}", "a".repeat(LONGEST));
        assert!(refused(&strict, &long).contains("at most 2000"));
        let loose = Rules {
            allow_http: true,
            allow_private: true,
            ..strict
        };
        for good in ["http://127.0.0.1:9000/hook", "http://[::1]/", "http://shop.internal/"] {
            check_url(&loose, good).unwrap();
        }
        for never in ["http://0.0.0.0/", "http://224.0.0.1/", "ws://127.0.0.1/"] {
            refused(&loose, never);
        }
    }
}
