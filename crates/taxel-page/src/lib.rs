//! The service over HTTP for curl and browsers, and the operator's page. README.md beside this crate says how to call it.
//!
//! JSON and server-sent events are made from the same protobuf messages by their descriptors, and every call goes
//! through the same services, checks and limits as one that comes over gRPC ([`taxel_rpc::SharedServices`]). So a call that is added to
//! the service is here as well, without a line of code.
//!
//! A browser lends its reach to every site that it shows. So the server answers to its own names alone (`Host`), takes no
//! request that a page from elsewhere made (`Origin`, `Sec-Fetch-Site`), grants nobody else anything (no CORS), and the
//! page loads nothing from elsewhere (`Content-Security-Policy`).

mod answer;
mod assets;
mod call;
mod events;
mod history;
mod limits;
mod methods;
mod metrics;
mod origin;
mod serve;
mod site;

pub use limits::Limits;
pub use serve::{Options, bind, serve};
