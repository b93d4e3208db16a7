//! Sets of up to 32 things, one bit each.

/// Implements the operations of a set for a type that holds its bits.
macro_rules! bit_set {
    ($name:ident) => {
        impl $name {
            /// Union.
            pub const fn with(self, o: Self) -> Self {
                Self(self.0 | o.0)
            }

            /// What is in `self` and not in `o`.
            pub const fn without(self, o: Self) -> Self {
                Self(self.0 & !o.0)
            }

            /// Whether everything of `o` is in `self`.
            pub const fn contains(self, o: Self) -> bool {
                self.0 & o.0 == o.0
            }

            /// Whether anything of `o` is in `self`.
            pub const fn intersects(self, o: Self) -> bool {
                self.0 & o.0 != 0
            }
        }
    };
}

pub(crate) use bit_set;
