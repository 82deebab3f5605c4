//! The three roles, and which each method needs: the one place that says so. A method that is not here is not served.

use std::fmt;

/// What somebody may do. Each may do what the one before it may, and more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Reads and streams; changes nothing.
    Observer,
    /// Also tares, calibrates, validates, activates model sets and configures boards.
    Operator,
    /// Also imports and deletes.
    Admin,
}

impl Role {
    /// All of them, least first.
    pub const ALL: [Self; 3] = [Self::Observer, Self::Operator, Self::Admin];

    /// As configurations and token files write it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Observer => "observer",
            Self::Operator => "operator",
            Self::Admin => "admin",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What a call takes a place of. One that is answered from what is known takes none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum What {
    /// A call that takes tens of milliseconds, or megabytes.
    LongCall,
    /// A stream.
    Stream,
}

/// What a method is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Method {
    /// Its full name, as in the request's path without the first slash.
    pub(crate) name: &'static str,
    /// The least role that may call it.
    pub(crate) role: Role,
    /// What it takes a place of, if of anything.
    pub(crate) takes: Option<What>,
}

const fn read(name: &'static str) -> Method {
    Method { name, role: Role::Observer, takes: None }
}

const fn stream(name: &'static str) -> Method {
    Method { takes: Some(What::Stream), ..read(name) }
}

const fn operate(name: &'static str) -> Method {
    Method { role: Role::Operator, ..read(name) }
}

const fn administer(name: &'static str) -> Method {
    Method { role: Role::Admin, ..read(name) }
}

/// That takes long, or has a large request or answer.
const fn long(method: Method) -> Method {
    Method { takes: Some(What::LongCall), ..method }
}

/// The one method that goes on for long and changes something all the while.
pub(crate) const PUSH: Method = Method { takes: Some(What::Stream), ..operate("taxel.v1.IngestService/PushScans") };

/// Every method that is served.
pub(crate) const METHODS: [Method; 31] = [
    read("taxel.v1.ForceService/GetForce"),
    stream("taxel.v1.ForceService/StreamForce"),
    read("taxel.v1.SkinService/GetSkin"),
    stream("taxel.v1.SkinService/StreamTaxels"),
    read("taxel.v1.SkinService/GetHealth"),
    stream("taxel.v1.SkinService/WatchEvents"),
    operate("taxel.v1.SkinService/Tare"),
    operate("taxel.v1.SkinService/BringUp"),
    read("taxel.v1.CalibrationService/GetSession"),
    read("taxel.v1.CalibrationService/ListSessions"),
    stream("taxel.v1.CalibrationService/WatchSession"),
    long(read("taxel.v1.CalibrationService/ExportSamples")),
    operate("taxel.v1.CalibrationService/StartSession"),
    operate("taxel.v1.CalibrationService/AdvanceSession"),
    long(operate("taxel.v1.CalibrationService/RefitSessions")),
    administer("taxel.v1.CalibrationService/DeleteSession"),
    read("taxel.v1.ModelService/ListModelSets"),
    read("taxel.v1.ModelService/GetModelSet"),
    long(read("taxel.v1.ModelService/ExportModelSet")),
    operate("taxel.v1.ModelService/ActivateModelSet"),
    long(administer("taxel.v1.ModelService/ImportModelSet")),
    administer("taxel.v1.ModelService/DeleteModelSet"),
    read("taxel.v1.ValidationService/GetValidation"),
    operate("taxel.v1.ValidationService/RecordLoad"),
    long(operate("taxel.v1.ValidationService/Recalibrate")),
    long(operate("taxel.v1.AuditService/ListAudit")),
    PUSH,
    read("grpc.health.v1.Health/Check"),
    stream("grpc.health.v1.Health/Watch"),
    stream("grpc.reflection.v1.ServerReflection/ServerReflectionInfo"),
    stream("grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"),
];

/// The method that a request's path names; `None` if it is not served.
pub(crate) fn method(path: &str) -> Option<Method> {
    let name = path.strip_prefix('/')?;
    METHODS.iter().copied().find(|method| method.name == name)
}
