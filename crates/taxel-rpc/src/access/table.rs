//! Which role each method needs: the one place that says so. A method that is not here is not served.

use crate::access::role::Role;

/// What a call costs beside its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Answered from what is known.
    Read,
    /// A stream that takes its place itself, once its request has come.
    Stream,
    /// A stream of a service that is not ours: its place is taken for it.
    ForeignStream,
    /// Goes to the engine and changes something.
    Command,
    /// A command that begins a session, which costs room on the disk for ever.
    SessionStart,
    /// A command whose request may be large: few are taken in at once.
    Import,
    /// A stream of requests that begins with a command and takes its place itself.
    Push,
}

impl Kind {
    /// Whether the request is one message, which has to come on.
    pub(crate) const fn has_one_request(self) -> bool {
        match self {
            Self::Read | Self::Stream | Self::Command | Self::SessionStart | Self::Import => true,
            Self::ForeignStream | Self::Push => false,
        }
    }
}

/// What a method is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Method {
    /// Its full name, as in the request's path without the first slash.
    pub(crate) name: &'static str,
    /// The least role that may call it.
    pub(crate) role: Role,
    pub(crate) kind: Kind,
}

const fn read(name: &'static str) -> Method {
    Method { name, role: Role::Observer, kind: Kind::Read }
}

const fn stream(name: &'static str) -> Method {
    Method { name, role: Role::Observer, kind: Kind::Stream }
}

const fn foreign(name: &'static str) -> Method {
    Method { name, role: Role::Observer, kind: Kind::ForeignStream }
}

const fn operate(name: &'static str) -> Method {
    Method { name, role: Role::Operator, kind: Kind::Command }
}

const fn administer(name: &'static str) -> Method {
    Method { name, role: Role::Admin, kind: Kind::Command }
}

/// The one method whose request may be large.
pub(crate) const IMPORT: &str = "taxel.v1.ModelService/ImportModelSet";

/// Every method that is served.
pub(crate) const METHODS: [Method; 39] = [
    read("taxel.v1.ForceService/GetForce"),
    stream("taxel.v1.ForceService/StreamForce"),
    read("taxel.v1.SkinService/GetSkin"),
    read("taxel.v1.SkinService/GetTaxels"),
    stream("taxel.v1.SkinService/StreamTaxels"),
    read("taxel.v1.SkinService/GetHealth"),
    read("taxel.v1.SkinService/ListEvents"),
    stream("taxel.v1.SkinService/WatchEvents"),
    operate("taxel.v1.SkinService/Tare"),
    operate("taxel.v1.SkinService/BringUp"),
    read("taxel.v1.CalibrationService/GetSession"),
    read("taxel.v1.CalibrationService/ListSessions"),
    stream("taxel.v1.CalibrationService/WatchSession"),
    stream("taxel.v1.CalibrationService/ExportSamples"),
    Method { name: "taxel.v1.CalibrationService/StartSession", role: Role::Operator, kind: Kind::SessionStart },
    operate("taxel.v1.CalibrationService/StartRamp"),
    operate("taxel.v1.CalibrationService/FinishRamp"),
    operate("taxel.v1.CalibrationService/AbortSession"),
    operate("taxel.v1.CalibrationService/DiscardSession"),
    operate("taxel.v1.CalibrationService/RefitSession"),
    operate("taxel.v1.CalibrationService/MergeSessions"),
    administer("taxel.v1.CalibrationService/DeleteSession"),
    read("taxel.v1.ModelService/ListModelSets"),
    read("taxel.v1.ModelService/GetModelSet"),
    read("taxel.v1.ModelService/GetTaxelModel"),
    read("taxel.v1.ModelService/ExportModelSet"),
    operate("taxel.v1.ModelService/ActivateModelSet"),
    Method { name: IMPORT, role: Role::Admin, kind: Kind::Import },
    administer("taxel.v1.ModelService/DeleteModelSet"),
    read("taxel.v1.ValidationService/GetValidation"),
    operate("taxel.v1.ValidationService/RecordLoad"),
    Method { name: "taxel.v1.ValidationService/ProposeRecalibration", role: Role::Operator, kind: Kind::Read },
    operate("taxel.v1.ValidationService/AcceptRecalibration"),
    Method { name: "taxel.v1.AuditService/ListAudit", role: Role::Operator, kind: Kind::Read },
    Method { name: "taxel.v1.IngestService/PushScans", role: Role::Operator, kind: Kind::Push },
    read("grpc.health.v1.Health/Check"),
    foreign("grpc.health.v1.Health/Watch"),
    foreign("grpc.reflection.v1.ServerReflection/ServerReflectionInfo"),
    foreign("grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"),
];

/// The method that a request's path names; `None` if it is not served.
pub(crate) fn method(path: &str) -> Option<Method> {
    let name = path.strip_prefix('/')?;
    METHODS.iter().copied().find(|method| method.name == name)
}
