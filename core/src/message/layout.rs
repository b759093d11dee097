//! How a message lies in memory, for programs in other languages.

use super::{Axes, Name, Note, Sector, Text, Twist};

/// The type of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Layout {
    /// One byte.
    U8,
    /// Four bytes, without sign.
    U32,
    /// Four bytes, with sign.
    I32,
    /// Eight bytes, without sign.
    U64,
    /// A floating-point number of eight bytes.
    F64,
    /// UTF-8 of so many bytes, padded with zeros.
    Text(usize),
    /// So many of one type, one after the other.
    Array(&'static Layout, usize),
    /// Fields, one after the other.
    Struct(&'static StructLayout),
}

/// The fields of a header, of an item, or of a part of either.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructLayout {
    /// Name of the type.
    pub name: &'static str,
    /// What it is, in words.
    pub docs: &'static str,
    /// Bytes.
    pub size: usize,
    /// Without gaps between them.
    pub fields: &'static [Field],
}

/// One field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// What it means, in words.
    pub docs: &'static str,
    /// From the beginning of the struct, bytes.
    pub offset: usize,
    /// Its type.
    pub layout: Layout,
}

/// A type whose layout is known.
pub trait Laid {
    /// The layout.
    const LAYOUT: Layout;
}

macro_rules! laid {
    ($($ty:ty = $layout:expr),* $(,)?) => { $(impl Laid for $ty { const LAYOUT: Layout = $layout; })* };
}

laid! {
    u8 = Layout::U8,
    u32 = Layout::U32,
    i32 = Layout::I32,
    u64 = Layout::U64,
    f64 = Layout::F64,
    // A set of axes is a number: a bit an axis.
    Axes = Layout::U32,
}

impl<const N: usize> Laid for Text<N> {
    const LAYOUT: Layout = Layout::Text(N);
}

impl<T: Laid, const N: usize> Laid for [T; N] {
    const LAYOUT: Layout = Layout::Array(&T::LAYOUT, N);
}

/// Tells the layout of a struct from its fields, with their docs.
macro_rules! lay {
    (
        $(#[doc = $doc:literal])* struct $ty:ident {
            $($(#[doc = $field_doc:literal])* pub $field:ident: $field_ty:ty,)*
        }
    ) => {
        impl crate::message::Laid for $ty {
            const LAYOUT: crate::message::Layout =
                crate::message::Layout::Struct(&crate::message::StructLayout {
                    name: stringify!($ty),
                    docs: concat!($($doc, "\n"),*),
                    size: size_of::<$ty>(),
                    fields: &[$(crate::message::Field {
                        name: stringify!($field),
                        docs: concat!($($field_doc, "\n"),*),
                        offset: std::mem::offset_of!($ty, $field),
                        layout: <$field_ty as crate::message::Laid>::LAYOUT,
                    }),*],
                });
        }
    };
}
pub(crate) use lay;

lay! {
    /// A planar velocity in the robot frame.
    struct Twist {
        /// Forward, m/s.
        pub linear: f64,
        /// To the left, m/s.
        pub lateral: f64,
        /// Turn rate, rad/s, left positive.
        pub angular: f64,
    }
}

lay! {
    /// A sector of directions of translation, robot frame.
    struct Sector {
        /// Middle, left positive, radians.
        pub center_rad: f64,
        /// Half width, radians; pi or more is every direction.
        pub half_width_rad: f64,
    }
}

const _: () = assert!(size_of::<Name>() == 32 && size_of::<Note>() == 64);

impl Layout {
    /// Bytes.
    pub const fn size(&self) -> usize {
        match self {
            Layout::U8 => 1,
            Layout::U32 | Layout::I32 => 4,
            Layout::U64 | Layout::F64 => 8,
            Layout::Text(bytes) => *bytes,
            Layout::Array(element, len) => element.size() * *len,
            Layout::Struct(layout) => layout.size,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::ALL;

    fn check(layout: &StructLayout) {
        let mut end = 0;
        for field in layout.fields {
            assert_eq!(field.offset, end, "{}.{}", layout.name, field.name);
            assert!(!field.docs.is_empty());
            end += field.layout.size();
            if let Layout::Struct(inner) = field.layout {
                check(inner);
            }
        }
        assert_eq!(end, layout.size, "{}", layout.name);
    }

    #[test]
    fn every_byte_of_every_message_belongs_to_a_field() {
        for message in ALL {
            let Layout::Struct(header) = message.header else { panic!("{} has no fields", message.name) };
            check(header);
            assert_eq!(header.size, message.header_size);
            assert_eq!(message.item.size(), message.item_size);
            if let Layout::Struct(item) = message.item {
                check(item);
            }
        }
    }
}
