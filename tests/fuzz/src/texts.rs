//! Texts of users of the engine: cameras, settings, messages.
use crate::memory::bounded;
use guardsplat_codeword::{MAX_BITS, Message};
use guardsplat_engine::embed::Preset;
use guardsplat_engine::view::parse_cameras;
use guardsplat_soft_binding::resolution::{self, Question};
use guardsplat_soft_binding::{BindingKey, Value};

/// `cameras.json`, `transforms.json`, and the cameras of a glTF.
pub fn cameras(data: &[u8]) {
    for camera in bounded(data.len(), || parse_cameras(data)).unwrap_or_default() {
        let numbers = [camera.fx, camera.fy, camera.cx, camera.cy]
            .into_iter()
            .chain(camera.translation);
        assert!(numbers.chain(camera.rotation.into_iter().flatten()).all(f32::is_finite));
        assert!(camera.width > 0 && camera.height > 0 && camera.fx > 0.0 && camera.fy > 0.0);
    }
}

/// Settings of an embedding, as JSON.
pub fn embed_settings(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let standard = Preset::Standard.settings();
    if let Ok(settings) = bounded(data.len(), || standard.overridden(text)) {
        settings.check().expect("settings that were taken are checked");
        let all = serde_json::to_string(&settings).expect("settings are JSON");
        // What single precision rounds to infinity or zero would not come back.
        assert_eq!(
            standard
                .overridden(&all)
                .expect("settings that were taken are taken again"),
            settings
        );
    }
}

/// Messages in hexadecimal, of which the server and the worker must think alike.
pub fn message(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    for bits in [1, 3, 4, 32, 33, MAX_BITS as usize] {
        let parsed = bounded(data.len(), || Message::parse(text, bits));
        let checked = guardsplat_server::grpc::fuzz_api::message(text, bits as u32);
        assert_eq!(parsed.is_ok(), checked.is_ok(), "{bits} bits");
        if let Ok(message) = parsed {
            assert_eq!(
                Message::parse(&message.to_string(), bits).expect("it is read back"),
                message
            );
        }
    }
}

/// Values of soft bindings, as content credentials of strangers have them. A key opens what was sealed with it alone.
pub fn soft_binding(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(value) = bounded(data.len(), || Value::parse(text)) else {
        return;
    };
    assert_eq!(Value::parse(&value.text()).as_ref(), Ok(&value));
    let id = value.key_id();
    let key = BindingKey {
        id: &id,
        secret: &[7; 32],
    };
    for bits in [1, 8, 32, 33, MAX_BITS as usize, usize::MAX] {
        if let Some(message) = value.open(key, bits) {
            assert_eq!(Value::seal(key, &message), Ok(value.clone()));
        }
    }
}

/// Questions of the resolution API: a line of method and target, as HTTP has it, and a body.
pub fn resolution(data: &[u8]) {
    let (line, body) = match data.iter().position(|byte| *byte == b'\n') {
        Some(end) => (&data[..end], &data[end + 1..]),
        None => (data, &[][..]),
    };
    let Ok(line) = std::str::from_utf8(line) else { return };
    let Some((method, target)) = line.split_once(' ') else {
        return;
    };
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    match bounded(data.len(), || resolution::parse(method, path, query, body)) {
        Ok(question) => {
            assert!(resolution::is_of_api(path), "{path}");
            if let Question::ByBinding { value, most } = question {
                assert!((1..=1000).contains(&most));
                let again = value.map(|value| (Value::parse(&value.text()), value));
                assert!(again.is_none_or(|(again, value)| again == Ok(value)));
            }
        }
        Err(refusal) => assert!((400..600).contains(&refusal.status) && !refusal.told.is_empty()),
    }
}
