//! Signatures of messages, as Standard Webhooks has them.
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hmac::{Hmac, KeyInit, Mac};
use hyper::header::HeaderMap;
use sha2::Sha256;

/// How far the time of a message may be from now, in seconds: one that somebody kept and sends again is refused.
const TOLERANCE: i64 = 5 * 60;
/// What the text of a secret begins with.
const PREFIX: &str = "whsec_";

/// What messages are signed with.
pub struct Secret(Hmac<Sha256>);

impl Secret {
    /// From the text that `hook create` printed; none where it is none.
    pub fn parse(text: &str) -> Option<Self> {
        let secret = STANDARD.decode(text.trim().strip_prefix(PREFIX)?).ok()?;
        // As short as the standard allows them.
        let long = secret.len() >= 24;
        Hmac::new_from_slice(&secret).ok().filter(|_| long).map(Self)
    }

    /// Whether a message is whole, of whoever knows the secret, and of now (seconds since 1970); if not, why.
    ///
    /// # Errors
    /// What is missing or wrong.
    pub fn check(&self, headers: &HeaderMap, body: &[u8], now: i64) -> Result<(), &'static str> {
        let header = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let id = header("webhook-id").ok_or("webhook-id is missing")?;
        let timestamp = header("webhook-timestamp").ok_or("webhook-timestamp is missing")?;
        let signatures = header("webhook-signature").ok_or("webhook-signature is missing")?;
        let time: i64 = timestamp.parse().map_err(|_| "webhook-timestamp is no number")?;
        let mut mac = self.0.clone();
        mac.update(format!("{id}.{timestamp}.").as_bytes());
        mac.update(body);
        // There may be several, while a secret is exchanged for another. Each is compared in constant time.
        let mut given = signatures.split(' ').filter_map(|one| one.strip_prefix("v1,"));
        let right = given.any(|one| {
            let bytes = STANDARD.decode(one).unwrap_or_default();
            mac.clone().verify_slice(&bytes).is_ok()
        });
        if !right {
            return Err("the signature is wrong");
        }
        // What is told of the time is of a sender that is known.
        match time.checked_sub(now).is_some_and(|off| off.abs() <= TOLERANCE) {
            true => Ok(()),
            false => Err("the time is more than five minutes off"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // The example of the specification's reference implementations.
    const SECRET: &str = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";
    const BODY: &[u8] = br#"{"test": 2432232314}"#;
    const TIME: i64 = 1_614_265_330;
    const SIGNATURE: &str = "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=";

    fn headers(id: &str, time: &str, signature: &str) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for (name, value) in [
            ("webhook-id", id),
            ("webhook-timestamp", time),
            ("webhook-signature", signature),
        ] {
            if !value.is_empty() {
                headers.insert(name, value.parse().unwrap());
            }
        }
        headers
    }

    #[test]
    fn only_the_signature_over_all_of_it_will_do() {
        let secret = Secret::parse(&format!(" {SECRET}\n")).unwrap();
        let id = "msg_p5jXN8AQM9LWM0D4loKWxJek";
        let time = TIME.to_string();
        let check = |headers: &HeaderMap, body: &[u8], now| secret.check(headers, body, now);
        let good = headers(id, &time, SIGNATURE);
        for now in [TIME, TIME + 300, TIME - 300] {
            assert_eq!(check(&good, BODY, now), Ok(()));
        }
        for now in [TIME + 301, TIME - 301, i64::MAX, i64::MIN] {
            assert!(check(&good, BODY, now).unwrap_err().contains("five minutes"), "{now}");
        }
        let several = format!("v1a,AAAA v1,AAAA {SIGNATURE}");
        assert_eq!(check(&headers(id, &time, &several), BODY, TIME), Ok(()));
        assert_eq!(check(&good, b"{}", TIME), Err("the signature is wrong"));
        let later = (TIME + 1).to_string();
        for (id, time, signature) in [
            ("another", time.as_str(), SIGNATURE),
            (id, &later, SIGNATURE),
            (id, &time, "v1,"),
            (id, &time, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1O8="),
            (id, &time, "v2,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="),
        ] {
            let error = check(&headers(id, time, signature), BODY, TIME);
            assert_eq!(error, Err("the signature is wrong"), "{id} {time} {signature}");
        }
        for (id, time, signature) in [("", time.as_str(), SIGNATURE), (id, "", SIGNATURE), (id, &time, "")] {
            assert!(
                check(&headers(id, time, signature), BODY, TIME)
                    .unwrap_err()
                    .contains("missing")
            );
        }
        assert!(check(&headers(id, "soon", SIGNATURE), BODY, TIME).is_err());
        let other = Secret::parse("whsec_AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=").unwrap();
        assert_eq!(other.check(&good, BODY, TIME), Err("the signature is wrong"));
    }

    #[test]
    fn a_secret_has_a_form() {
        for wrong in [
            "",
            "whsec_",
            "whsec_AAAA",
            "gst_1_2",
            &SECRET[6..],
            "whsec_no base64 at all in here, is there",
        ] {
            assert!(Secret::parse(wrong).is_none(), "{wrong}");
        }
    }
}
