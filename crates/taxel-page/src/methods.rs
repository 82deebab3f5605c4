//! The calls that there are, found by name in the compiled descriptors.

use prost_reflect::{DescriptorPool, DynamicMessage, Kind, MethodDescriptor};
use serde_json::{Map, Value};
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tonic::{Code, Status};

/// The one call whose request may be large.
const IMPORT: &str = "taxel.v1.ModelService.ImportModelSet";

/// Every method of the service.
#[derive(Clone, Debug)]
pub(crate) struct Methods {
    pool: DescriptorPool,
}

impl Methods {
    /// Reads the compiled descriptors.
    pub(crate) fn new() -> Result<Self, prost_reflect::DescriptorError> {
        DescriptorPool::decode(taxel_proto::DESCRIPTORS).map(|pool| Self { pool })
    }

    /// The method of this path, `taxel.v1.Service/Method`.
    pub(crate) fn find(&self, path: &str) -> Result<Method, Status> {
        let found = path.split_once('/').and_then(|(service, method)| {
            self.pool.get_service_by_name(service)?.methods().find(|known| known.name() == method)
        });
        let found = found.filter(|method| !method.is_client_streaming());
        let short = || path.chars().take(100).collect::<String>();
        let unknown = || {
            let why = format!("there is no call `{}`: expected one of proto/taxel/v1", short());
            Refusal::new(Code::Unimplemented, ErrorReason::MethodUnknown, why)
        };
        Ok(found.map(|descriptor| Method { descriptor }).ok_or_else(unknown)?)
    }
}

/// One method.
#[derive(Clone, Debug)]
pub(crate) struct Method {
    descriptor: MethodDescriptor,
}

impl Method {
    /// `taxel.v1.Service/Method`.
    pub(crate) fn path(&self) -> String {
        format!("{}/{}", self.descriptor.parent_service().full_name(), self.descriptor.name())
    }

    /// Whether it answers with a stream.
    pub(crate) fn streams(&self) -> bool {
        self.descriptor.is_server_streaming()
    }

    /// Whether its request may be as large as a model set.
    pub(crate) fn takes_models(&self) -> bool {
        self.descriptor.full_name() == IMPORT
    }

    /// What its answers are.
    pub(crate) fn output(&self) -> prost_reflect::MessageDescriptor {
        self.descriptor.output()
    }

    /// The request that this JSON describes; nothing at all is the empty request.
    pub(crate) fn request(&self, json: &[u8]) -> Result<DynamicMessage, Status> {
        let input = self.descriptor.input();
        if json.is_empty() {
            return Ok(DynamicMessage::new(input));
        }
        let refused =
            |error| Refusal::unreadable(format!("the body is not the JSON of {}: {error}", input.full_name()));
        let mut reader = serde_json::Deserializer::from_slice(json);
        let message = DynamicMessage::deserialize(input.clone(), &mut reader).map_err(refused)?;
        reader.end().map_err(refused)?;
        Ok(message)
    }

    /// The request whose fields have these values, as a query has them.
    pub(crate) fn request_of(&self, fields: &[(String, String)]) -> Result<DynamicMessage, Status> {
        let input = self.descriptor.input();
        let mut object = Map::new();
        for (name, text) in fields {
            let field = input.get_field_by_json_name(name).or_else(|| input.get_field_by_name(name));
            let is_bool = field.is_some_and(|field| field.kind() == Kind::Bool);
            let value = match text.as_str() {
                "true" | "false" if is_bool => Value::Bool(text == "true"),
                _ => Value::String(text.clone()), // numbers may be strings in the JSON of protobuf
            };
            object.insert(name.clone(), value);
        }
        let refused = |error| Refusal::unreadable(format!("the query is not {}: {error}", input.full_name()));
        Ok(DynamicMessage::deserialize(input.clone(), Value::Object(object)).map_err(refused)?)
    }
}
