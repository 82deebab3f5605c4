//! Enumerations whose variants have a word each: list and words are one table.

/// An enumeration with `ALL` its variants, and the `name` of each.
macro_rules! named {
    (
        $(#[$of:meta])*
        pub enum $Of:ident {
            $($(#[$variant:meta])* $Variant:ident = $name:literal,)+
        }
    ) => {
        $(#[$of])*
        pub enum $Of {
            $($(#[$variant])* $Variant,)+
        }

        impl $Of {
            /// Every one, in this order.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$Variant),+];

            /// The word for it.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$Variant => $name,)+
                }
            }
        }
    };
}

pub(crate) use named;
