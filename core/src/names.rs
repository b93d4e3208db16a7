//! Names of the values of plain enums, in one list each.

/// Gives an enum without data a name for each value: `names!(Norm: Mean = "mean", Max = "max");`.
macro_rules! names {
    ($T:ident: $first:ident = $name:literal $(, $variant:ident = $more:literal)* $(,)?) => {
        impl $T {
            /// Names of all values.
            pub(crate) const NAMES: &'static [&'static str] = &[$name $(, $more)*];

            /// Names of all values, with bars between them.
            pub(crate) const ALTERNATIVES: &'static str = concat!($name $(, "|", $more)*);

            /// Name of the value in texts.
            pub const fn name(self) -> &'static str {
                match self {
                    Self::$first => $name,
                    $(Self::$variant => $more,)*
                }
            }

            /// Value of this name.
            pub(crate) fn from_name(name: &str) -> Option<Self> {
                match name {
                    $name => Some(Self::$first),
                    $($more => Some(Self::$variant),)*
                    _ => None,
                }
            }
        }
    };
}

pub(crate) use names;
