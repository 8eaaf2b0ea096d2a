//! Little-endian fields one after the other, without padding.

use crate::units::{AngleQ, DampingQ, ForceQ, StiffnessQ, TipTorqueQ, TorqueQ, VelocityQ};

/// The bytes still to be written.
pub(crate) struct Writer<'a>(pub(crate) &'a mut [u8]);

/// The bytes still to be read.
pub(crate) struct Reader<'a>(pub(crate) &'a [u8]);

/// A value with one width on the wire. Messages add these widths up in their `LEN`, so neither end runs short; tests
/// check that nothing is left over.
pub(crate) trait Field: Copy {
    /// Width in bytes.
    const LEN: usize;
    /// Writes the next bytes.
    fn put(self, out: &mut Writer<'_>);
    /// Reads the next bytes.
    fn get(input: &mut Reader<'_>) -> Self;
}

macro_rules! number_fields {
    ($($int:ty),*) => {$(
        impl Field for $int {
            const LEN: usize = size_of::<$int>();

            fn put(self, out: &mut Writer<'_>) {
                let all = core::mem::take(&mut out.0);
                if let Some((head, rest)) = all.split_first_chunk_mut() {
                    *head = self.to_le_bytes();
                    out.0 = rest;
                }
            }

            fn get(input: &mut Reader<'_>) -> Self {
                let (head, rest) = input.0.split_first_chunk().unwrap_or((&[0; size_of::<$int>()], &[]));
                input.0 = rest;
                Self::from_le_bytes(*head)
            }
        }
    )*};
}

number_fields!(u8, u16, u32, i16, f32);

macro_rules! newtype_fields {
    ($($name:ident),*) => {$(
        impl Field for $name {
            const LEN: usize = size_of::<$name>();

            fn put(self, out: &mut Writer<'_>) {
                self.0.put(out);
            }

            fn get(input: &mut Reader<'_>) -> Self {
                Self(Field::get(input))
            }
        }
    )*};
}

newtype_fields!(AngleQ, VelocityQ, TorqueQ, ForceQ, TipTorqueQ, StiffnessQ, DampingQ);

impl<F: Field, const N: usize> Field for [F; N] {
    const LEN: usize = N * F::LEN;

    // One look at the length for all of them.
    fn put(self, out: &mut Writer<'_>) {
        let Some((head, rest)) = core::mem::take(&mut out.0).split_at_mut_checked(Self::LEN) else { return };
        out.0 = rest;
        for (field, place) in self.into_iter().zip(head.chunks_exact_mut(F::LEN)) {
            field.put(&mut Writer(place));
        }
    }

    fn get(input: &mut Reader<'_>) -> Self {
        core::array::from_fn(|_| F::get(input))
    }
}
