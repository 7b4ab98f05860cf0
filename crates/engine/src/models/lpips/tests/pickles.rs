//! Pickles that are not weights, or not what they seem.
use super::super::pickle::load;
use super::super::value::{Atom, Value};
use super::Pickle;

/// A pickle with this between protocol and end.
fn pickle(body: &[u8]) -> Vec<u8> {
    [b"\x80\x03", body, b"."].concat()
}

fn reason(body: &[u8]) -> String {
    load(&pickle(body)).unwrap_err()
}

/// A small pickle that has every opcode which is read.
fn all_opcodes() -> Vec<u8> {
    let mut all = Pickle::new();
    all.put(b"}q\0(")
        .text("one")
        .put(b"q\x01}")
        .text("kernel")
        .array(&[2, 1], &[0; 8])
        .put(b"s");
    all.text("two").put(b"h\x01u").text("three").put(b"M\x01\x02s.");
    all.0
}

#[test]
fn dictionaries_texts_numbers_and_arrays_are_read() {
    let bytes = all_opcodes();
    let Value::Dict(root) = load(&bytes).unwrap() else {
        panic!()
    };
    assert_eq!(root["two"], Value::Atom(Atom::Text("one")));
    assert_eq!(root["three"], Value::Atom(Atom::Int(513)));
    let Value::Dict(one) = &root["one"] else { panic!() };
    let Value::Array(array) = &one["kernel"] else { panic!() };
    assert_eq!((&array.shape[..], array.data), (&[2, 1][..], &[0; 8][..]));
}

#[test]
fn pickles_that_are_cut_off_anywhere_are_refused() {
    let whole = all_opcodes();
    for end in 0..whole.len() {
        let reason = load(&whole[..end]).unwrap_err();
        assert!(reason.starts_with("byte "), "{end}: {reason}");
    }
}

#[test]
fn any_other_byte_anywhere_does_no_harm() {
    let whole = all_opcodes();
    for at in 0..whole.len() {
        let mut changed = whole.clone();
        for byte in 0..=u8::MAX {
            changed[at] = byte;
            let _ = load(&changed);
        }
    }
}

#[test]
fn what_would_run_something_is_refused_by_name() {
    assert_eq!(
        reason(b"cos\nsystem\nX\x02\0\0\0ls\x85R"),
        "byte 2: wants os.system, and weights have no need of it"
    );
    for (body, name) in [
        (&b"(S'ls'\nios\nsystem\n"[..], "STRING"),
        (b"ios\nsystem\n", "INST"),
        (b"(o", "OBJ"),
        (b"\x81", "NEWOBJ"),
        (b"\x92", "NEWOBJ_EX"),
        (b"\x93", "STACK_GLOBAL"),
        (b"\x82\x01", "EXT1"),
        (b"P0\n", "PERSID"),
        (b"Q", "BINPERSID"),
        (b"\x95\0\0\0\0\0\0\0\0", "FRAME"),
        (b"\x96", "BYTEARRAY8"),
        (b"\x97", "NEXT_BUFFER"),
        (b"I1\n", "INT"),
        (b"\x8b", "LONG4"),
        (b"]", "EMPTY_LIST"),
        (b"2", "DUP"),
        (b"r\0\0\0\0", "LONG_BINPUT"),
        (b"\x94", "MEMOIZE"),
    ] {
        let found = reason(body);
        assert!(
            found.ends_with(&format!("the opcode {name} is not one that weights need")),
            "{found}"
        );
    }
    assert!(reason(b"\xff").ends_with("0xff is no opcode"));
}

#[test]
fn functions_are_not_called_otherwise_than_for_arrays() {
    for (body, needle) in [
        (
            &b"cnumpy\ndtype\nX\x01\0\0\0O\x89\x88\x87R"[..],
            "numbers of type \"O\"",
        ),
        (b"cnumpy\ndtype\n)R", "EMPTY_TUPLE"),
        (b"cnumpy\ndtype\n(tR", "arguments that arrays are not made with"),
        (b"cnumpy\nndarray\n(tR", "calls a class"),
        (b"K\x01(tR", "calls a number"),
        (b"cnumpy\ndtype\nK\x01R", "a tuple is wanted, not a number"),
        (
            b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x05\x85C\x01b\x87R",
            "arguments that arrays",
        ),
        (b"}(tb", "gives a state to a dictionary"),
        (
            b"cnumpy\ndtype\nX\x02\0\0\0f4\x89\x88\x87R(K\x03X\x01\0\0\0>NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tb",
            "byte order \">\"",
        ),
        (
            b"cnumpy\ndtype\nX\x02\0\0\0f4\x89\x88\x87R(K\x03X\x01\0\0\0<tb",
            "numbers with fields",
        ),
    ] {
        let found = reason(body);
        assert!(found.contains(needle), "{found}");
    }
    for (shape, numbers, needle) in [
        (&[3][..], 8, "shape [3] with 8 bytes"),
        (&[usize::MAX], 8, "not of numbers from 0"),
        (&[1 << 30, 1 << 30, 1 << 30], 8, "with 8 bytes"),
        (&[0], 8, "shape [0] with 8 bytes"),
    ] {
        let mut array = Pickle::new();
        array.array(shape, &vec![0; numbers]).put(b".");
        let found = load(&array.0).unwrap_err();
        assert!(found.contains(needle), "{found}");
    }
}

#[test]
fn lengths_are_not_believed() {
    for body in [&b"X\xff\xff\xff\xff"[..], b"B\xff\xff\xff\xff", b"C\xff"] {
        let found = reason(body);
        assert!(found.contains("the pickle ends here"), "{found}");
    }
    assert!(reason(&[b"c", &[b'a'; 100][..]].concat()).contains("a name has no end within 64 bytes"));
    assert!(reason(b"X\x01\0\0\0\xff").contains("not UTF-8"));
}

#[test]
fn nothing_grows_without_end() {
    // Values, marks, and things to remember: all are opcodes, and those are counted.
    for body in [&b"N"[..], b"(", b"}", b"Nq\0", b"h\0"] {
        let body = [b"Nq\0", &body.repeat(100_000)[..]].concat();
        assert!(reason(&body).contains("more than 1024 opcodes"), "{}", reason(&body));
    }
    // One within another, whose end would take as deep a recursion.
    assert!(reason(&[b"N", &b"\x85".repeat(900)[..]].concat()).contains("nested deeper than 4"));
    let dictionaries = [b"}X\x01\0\0\0a".repeat(900), b"s".repeat(900)].concat();
    assert!(reason(&dictionaries).contains("more than 1024 opcodes"));
    let dictionaries = [b"}X\x01\0\0\0a".repeat(20), b"}".to_vec(), b"s".repeat(20)].concat();
    assert!(reason(&dictionaries).contains("nested deeper than 4"));
    // A dictionary in itself, and pairs of pairs that double with every line.
    assert!(reason(b"}q\0X\x01\0\0\0ah\0s").contains("value 0 is used twice and has parts"));
    assert!(reason(b"N\x85q\0h\0h\0\x87").contains("value 0 is used twice and has parts"));
}

#[test]
fn stack_and_memo_must_have_what_is_taken_from_them() {
    for (body, needle) in [
        (&b""[..], "a value is wanted and there is none"),
        (b"(", "a value is wanted where a mark is"),
        (b"t", "a mark is wanted and there is none"),
        (b"u", "a mark is wanted and there is none"),
        (b"R", "a value is wanted and there is none"),
        (b"N\x87", "a value is wanted and there is none"),
        (b"q\0", "there is no value to remember"),
        (b"(q\0", "there is no value to remember"),
        (b"h\x07", "value 7 was not remembered"),
        (b"NNNs", "a dictionary is wanted, not None"),
        (b"}NNs", "a key is None, not a text"),
        (b"}(X\x01\0\0\0au", "the key \"a\" has no value"),
        (b"}(X\x01\0\0\0aNX\x01\0\0\0aNu", "the key \"a\" is there twice"),
        (b"NN", "1 values are left over"),
        (b"N.N", "2 bytes follow the end"),
        (b"\x80\x03N", "protocol first, and once"),
    ] {
        let found = reason(body);
        assert!(found.contains(needle), "{found}, expected {needle}");
    }
    assert!(load(b"").unwrap_err().contains("the pickle ends here"));
    assert!(load(b"N.").unwrap_err().contains("protocol first"));
    assert!(load(b"\x80\x05N.").unwrap_err().contains("protocol 5, expected 3"));
}
