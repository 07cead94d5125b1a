//! Small numbers where a level has no better form for them than words.

/// What a level says that has no operations of its own on small numbers: they are words.
macro_rules! small_numbers_are_words {
    () => {
        #[inline(always)]
        fn narrow(self, a: Self::Words) -> Self::Words {
            a
        }

        #[inline(always)]
        fn widen_high(self, a: Self::Words) -> Self::Words {
            self.shift_left::<8>(a)
        }

        #[inline(always)]
        fn splat_small(self, value: i8) -> Self::Words {
            self.splat(value.into())
        }

        #[inline(always)]
        fn add_small(self, a: Self::Words, b: Self::Words) -> Self::Words {
            self.add(a, b)
        }

        #[inline(always)]
        fn min_small(self, a: Self::Words, b: Self::Words) -> Self::Words {
            self.min(a, b)
        }

        #[inline(always)]
        fn max_small(self, a: Self::Words, b: Self::Words) -> Self::Words {
            self.max(a, b)
        }

        #[inline(always)]
        fn absolute_small(self, a: Self::Words) -> Self::Words {
            self.absolute(a)
        }

        #[inline(always)]
        fn with_sign_small(self, magnitude: Self::Words, sign: Self::Words) -> Self::Words {
            self.with_sign(magnitude, sign)
        }

        #[inline(always)]
        fn greater_small(self, a: Self::Words, b: Self::Words) -> Self::Mask {
            self.greater(a, b)
        }

        #[inline(always)]
        fn both_small(self, a: Self::Mask, b: Self::Mask) -> Self::Mask {
            self.both(a, b)
        }

        #[inline(always)]
        fn select_small(self, mask: Self::Mask, yes: Self::Words, no: Self::Words) -> Self::Words {
            self.select(mask, yes, no)
        }
    };
}
pub(super) use small_numbers_are_words;
