//! Every service, call, message, field and enum value of the API says what it is.

use prost::Message;
use prost_types::field_descriptor_proto::Type;
use prost_types::source_code_info::Location;
use prost_types::{DescriptorProto, EnumDescriptorProto, FileDescriptorProto, FileDescriptorSet};

// Field numbers in google/protobuf/descriptor.proto, of which the paths in the source information consist.
const FILE_MESSAGE: i32 = 4;
const FILE_ENUM: i32 = 5;
const FILE_SERVICE: i32 = 6;
const MESSAGE_FIELD: i32 = 2;
const MESSAGE_NESTED: i32 = 3;
const MESSAGE_ENUM: i32 = 4;
const ENUM_VALUE: i32 = 2;
const SERVICE_METHOD: i32 = 2;

struct Comments<'a> {
    locations: &'a [Location],
    missing: Vec<String>,
    seen: usize,
}

impl Comments<'_> {
    fn check(&mut self, path: &[i32], name: &str) -> String {
        self.seen += 1;
        let location = self.locations.iter().find(|location| location.path == path);
        let comment = location.map(|l| l.leading_comments().to_owned()).unwrap_or_default();
        if comment.trim().len() < 8 {
            self.missing.push(name.to_owned());
        }
        comment
    }

    fn message(&mut self, path: &[i32], parent: &str, message: &DescriptorProto) {
        let name = format!("{parent}.{}", message.name());
        self.check(path, &name);
        for (i, field) in message.field.iter().enumerate() {
            self.check(&[path, &[MESSAGE_FIELD, i as i32]].concat(), &format!("{name}.{}", field.name()));
        }
        for (i, nested) in message.nested_type.iter().enumerate() {
            self.message(&[path, &[MESSAGE_NESTED, i as i32]].concat(), &name, nested);
        }
        for (i, nested) in message.enum_type.iter().enumerate() {
            self.enumeration(&[path, &[MESSAGE_ENUM, i as i32]].concat(), &name, nested);
        }
    }

    fn enumeration(&mut self, path: &[i32], parent: &str, enumeration: &EnumDescriptorProto) {
        let name = format!("{parent}.{}", enumeration.name());
        self.check(path, &name);
        for (i, value) in enumeration.value.iter().enumerate() {
            self.check(&[path, &[ENUM_VALUE, i as i32]].concat(), &format!("{name}.{}", value.name()));
        }
    }

    fn services(&mut self, file: &FileDescriptorProto) {
        for (i, service) in file.service.iter().enumerate() {
            let path = [FILE_SERVICE, i as i32];
            let about = self.check(&path, service.name());
            assert!(about.contains("UNAVAILABLE"), "{} does not say when all its calls fail", service.name());
            for (k, method) in service.method.iter().enumerate() {
                let name = format!("{}.{}", service.name(), method.name());
                let comment = self.check(&[&path[..], &[SERVICE_METHOD, k as i32]].concat(), &name);
                let errors = ["INVALID_ARGUMENT:", "no error of its own"];
                assert!(errors.iter().any(|e| comment.contains(e)), "{name} does not list its errors");
            }
        }
    }
}

/// A figure is of no use without its unit and what it can be.
#[test]
fn every_figure_of_a_validation_has_its_unit_and_its_range() {
    const UNITS: [&str; 8] =
        ["in N", "in kg", "in mm2", "in %", "hare of", "multiplied by", "1 means", "in standard deviations"];
    const COUNTS: [&str; 3] = ["umber of", "Its number", "Most taxels"];
    const RANGES: [&str; 4] = ["above 0", "or more", "Above -100", "0 to "];
    let set = FileDescriptorSet::decode(taxel_proto::DESCRIPTORS).unwrap();
    let file = set.file.iter().find(|file| file.name().ends_with("validation.proto")).unwrap();
    let locations = &file.source_code_info.as_ref().unwrap().location;
    let mut figures = 0;
    for (m, message) in file.message_type.iter().enumerate() {
        for (f, field) in message.field.iter().enumerate() {
            let path = [FILE_MESSAGE, m as i32, MESSAGE_FIELD, f as i32];
            let comment = locations.iter().find(|l| l.path == path).unwrap().leading_comments().replace("\n ", " ");
            let says = |words: &[&str]| words.iter().any(|word| comment.contains(word));
            let name = format!("{}.{}: {comment}", message.name(), field.name());
            let units = match field.r#type() {
                Type::Double => &UNITS[..],
                Type::Uint32 | Type::Uint64 => &COUNTS,
                _ => continue,
            };
            assert!(says(units) || says(&["standard uncertainty, above 0"]), "no unit: {name}");
            assert!(says(&RANGES), "no range: {name}");
            figures += 1;
        }
    }
    assert!(figures > 20, "{figures}");
}

#[test]
fn every_element_of_the_api_has_a_comment() {
    let set = FileDescriptorSet::decode(taxel_proto::DESCRIPTORS).unwrap();
    let ours: Vec<_> = set.file.iter().filter(|file| file.package() == "taxel.v1").collect();
    assert_eq!(ours.len(), 10);
    let mut seen = 0;
    for file in ours {
        let locations = &file.source_code_info.as_ref().unwrap().location;
        let mut comments = Comments { locations, missing: Vec::new(), seen: 0 };
        for (i, message) in file.message_type.iter().enumerate() {
            comments.message(&[FILE_MESSAGE, i as i32], file.package(), message);
        }
        for (i, enumeration) in file.enum_type.iter().enumerate() {
            comments.enumeration(&[FILE_ENUM, i as i32], file.package(), enumeration);
        }
        comments.services(file);
        assert!(comments.missing.is_empty(), "{}: without comment: {:#?}", file.name(), comments.missing);
        seen += comments.seen;
    }
    assert!(seen > 200, "only {seen} elements were looked at");
}
