//! Who may call what.
//!
//! A connection has an [`origin`](origin::Origin): an account on a Unix socket, an address, or a certificate. The
//! [`rules`](rules::Rules) of the configuration make a role of it, or a token in the call does. One [`table`] says which
//! role each method needs; what is not in the table is not served. The [`layer`](layer::Gate) stands before all
//! services and asks both.

pub(crate) mod layer;
pub(crate) mod origin;
pub(crate) mod private_file;
pub(crate) mod rules;
pub(crate) mod table;
pub(crate) mod token;
