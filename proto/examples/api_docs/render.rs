//! Turns descriptors and their comments into a page of Markdown.
use std::collections::HashMap;

use guardsplat_proto::FILE_DESCRIPTORS;
use prost::{DecodeError, Message};
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet,
    ServiceDescriptorProto,
};

/// Where the page is kept.
pub const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/api.md");

const PREFACE: &str = include_str!("preface.md");
const PACKAGE: &str = "guardsplat.v1";
/// The order that a reader wants.
const FILES: [&str; 8] = [
    "job_service",
    "job",
    "artifact_service",
    "key_service",
    "registry_service",
    "token_service",
    "hook_service",
    "worker_service",
];

// Numbers of fields in descriptor.proto, of which paths to comments are made.
const MESSAGES: i32 = 4;
const SERVICES: i32 = 6;
const MEMBERS: i32 = 2; // methods of a service, fields of a message, values of an enum
const NESTED_ENUMS: i32 = 4;
const ONEOFS: i32 = 8;

/// The page, as the protos are.
pub fn page() -> Result<String, DecodeError> {
    let set = FileDescriptorSet::decode(FILE_DESCRIPTORS)?;
    let mut page = PREFACE.to_owned();
    for name in FILES {
        let path = format!("guardsplat/v1/{name}.proto");
        for file in set.file.iter().filter(|file| file.name() == path) {
            File::new(file).render(&mut page);
        }
    }
    Ok(page)
}

struct File<'a> {
    file: &'a FileDescriptorProto,
    comments: HashMap<&'a [i32], String>,
}

impl<'a> File<'a> {
    fn new(file: &'a FileDescriptorProto) -> Self {
        let locations = file.source_code_info.iter().flat_map(|info| &info.location);
        let comments = locations.filter_map(|l| Some((l.path.as_slice(), one_line(l.leading_comments.as_deref()?))));
        Self {
            file,
            comments: comments.collect(),
        }
    }

    fn comment(&self, path: &[i32]) -> &str {
        self.comments.get(path).map_or("", String::as_str)
    }

    fn render(&self, page: &mut String) {
        for (i, service) in (0..).zip(&self.file.service) {
            self.service(service, &[SERVICES, i], page);
        }
        for (i, message) in (0..).zip(&self.file.message_type) {
            self.message(message, &[MESSAGES, i], page);
        }
    }

    fn service(&self, service: &ServiceDescriptorProto, path: &[i32], page: &mut String) {
        page.push_str(&format!("\n## {}\n\n{}\n\n", service.name(), self.comment(path)));
        page.push_str("| call | takes | gives | |\n|---|---|---|---|\n");
        for (i, method) in (0..).zip(&service.method) {
            let stream = |streams: bool| if streams { "stream of " } else { "" };
            page.push_str(&format!(
                "| `{}` | {}{} | {}{} | {} |\n",
                method.name(),
                stream(method.client_streaming()),
                link(method.input_type()),
                stream(method.server_streaming()),
                link(method.output_type()),
                self.comment(&[path, &[MEMBERS, i]].concat()),
            ));
        }
    }

    fn message(&self, message: &DescriptorProto, path: &[i32], page: &mut String) {
        page.push_str(&format!("\n### {}\n\n{}\n", message.name(), self.comment(path)));
        if !message.field.is_empty() {
            page.push_str("\n| field | type | |\n|---|---|---|\n");
        }
        for (i, field) in (0..).zip(&message.field) {
            let comment = self.comment(&[path, &[MEMBERS, i]].concat());
            let group = self
                .one_of(message, field, path)
                .map(|group| format!("{group} "))
                .unwrap_or_default();
            page.push_str(&format!(
                "| `{}` | {} | {group}{comment} |\n",
                field.name(),
                kind(field)
            ));
        }
        for (i, nested) in (0..).zip(&message.enum_type) {
            self.values(message, nested, &[path, &[NESTED_ENUMS, i]].concat(), page);
        }
    }

    /// What a field of a oneof shares with the others.
    fn one_of(&self, message: &DescriptorProto, field: &FieldDescriptorProto, path: &[i32]) -> Option<String> {
        if field.proto3_optional() {
            return None;
        }
        let index = field.oneof_index?;
        let name = message.oneof_decl.get(usize::try_from(index).ok()?)?.name();
        let comment = self.comment(&[path, &[ONEOFS, index]].concat());
        // The group is told with its first field; the others only name it.
        let first = message.field.iter().find(|other| other.oneof_index == Some(index))?;
        let comment = if first.number == field.number { comment } else { "" };
        Some(format!("One of `{name}`. {comment}").trim_end().to_owned())
    }

    fn values(&self, message: &DescriptorProto, nested: &EnumDescriptorProto, path: &[i32], page: &mut String) {
        page.push_str(&format!(
            "\n### {}.{}\n\n{}\n\n",
            message.name(),
            nested.name(),
            self.comment(path)
        ));
        page.push_str("| value | number | |\n|---|---|---|\n");
        for (i, value) in (0..).zip(&nested.value) {
            let comment = self.comment(&[path, &[MEMBERS, i]].concat());
            page.push_str(&format!("| `{}` | {} | {comment} |\n", value.name(), value.number()));
        }
    }
}

fn kind(field: &FieldDescriptorProto) -> String {
    let name = match field.r#type() {
        Type::Message | Type::Enum => link(field.type_name()),
        Type::Double => "double".into(),
        Type::Int32 => "int32".into(),
        Type::Int64 => "int64".into(),
        Type::Uint32 => "uint32".into(),
        Type::Uint64 => "uint64".into(),
        Type::Bool => "bool".into(),
        Type::String => "string".into(),
        Type::Bytes => "bytes".into(),
        other => other.as_str_name().to_lowercase(),
    };
    match (field.label(), field.proto3_optional()) {
        (Label::Repeated, _) => format!("repeated {name}"),
        (_, true) => format!("optional {name}"),
        _ => name,
    }
}

/// A type's name, with a link to it where it is on this page.
fn link(full: &str) -> String {
    let full = full.trim_start_matches('.');
    match full.strip_prefix(PACKAGE).and_then(|rest| rest.strip_prefix('.')) {
        Some(name) => format!("[{name}](#{})", name.to_lowercase().replace('.', "")),
        None => format!("`{full}`"),
    }
}

/// A comment on one line, as tables need it.
fn one_line(comment: &str) -> String {
    comment
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .replace('|', "\\|")
}
