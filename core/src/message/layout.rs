//! Memory layout of messages, for programs in other languages.

use super::{Axes, Name, Note, Sector, Text, Twist};

/// Type of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Layout {
    /// One unsigned byte.
    U8,
    /// Unsigned 32-bit integer.
    U32,
    /// Signed 32-bit integer.
    I32,
    /// Unsigned 64-bit integer.
    U64,
    /// 64-bit floating-point number.
    F64,
    /// UTF-8 text of this many bytes, padded with zeros.
    Text(usize),
    /// Array of this element type and length.
    Array(&'static Layout, usize),
    /// Struct.
    Struct(&'static StructLayout),
}

/// Layout of a header, of an item, or of a struct inside either. Its fields have no gaps between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructLayout {
    /// Name of the type.
    pub name: &'static str,
    /// Doc comment of the type.
    pub docs: &'static str,
    /// Size, bytes.
    pub size: usize,
    /// Fields in memory order.
    pub fields: &'static [Field],
}

/// Layout of one field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Name of the field.
    pub name: &'static str,
    /// Doc comment of the field.
    pub docs: &'static str,
    /// Offset from the beginning of the struct, bytes.
    pub offset: usize,
    /// Type of the field.
    pub layout: Layout,
}

/// A type with a known memory layout.
pub trait HasLayout {
    /// Memory layout of the type.
    const LAYOUT: Layout;
}

macro_rules! primitive_layouts {
    ($($ty:ty = $layout:expr),* $(,)?) => { $(impl HasLayout for $ty { const LAYOUT: Layout = $layout; })* };
}

primitive_layouts! {
    u8 = Layout::U8,
    u32 = Layout::U32,
    i32 = Layout::I32,
    u64 = Layout::U64,
    f64 = Layout::F64,
    // A set of axes is a bit field.
    Axes = Layout::U32,
}

impl<const N: usize> HasLayout for Text<N> {
    const LAYOUT: Layout = Layout::Text(N);
}

impl<T: HasLayout, const N: usize> HasLayout for [T; N] {
    const LAYOUT: Layout = Layout::Array(&T::LAYOUT, N);
}

/// Implements [`HasLayout`] for a struct from its fields and their doc comments.
#[doc(hidden)]
#[macro_export]
macro_rules! struct_layout {
    (
        $(#[doc = $doc:literal])* struct $ty:ident {
            $($(#[doc = $field_doc:literal])* pub $field:ident: $field_ty:ty,)*
        }
    ) => {
        impl $crate::message::HasLayout for $ty {
            const LAYOUT: $crate::message::Layout =
                $crate::message::Layout::Struct(&$crate::message::StructLayout {
                    name: stringify!($ty),
                    docs: concat!($($doc, "\n"),*),
                    size: size_of::<$ty>(),
                    fields: &[$($crate::message::Field {
                        name: stringify!($field),
                        docs: concat!($($field_doc, "\n"),*),
                        offset: std::mem::offset_of!($ty, $field),
                        layout: <$field_ty as $crate::message::HasLayout>::LAYOUT,
                    }),*],
                });
        }
    };
}

struct_layout! {
    /// A planar velocity in the robot frame.
    struct Twist {
        /// Forward speed, m/s.
        pub linear: f64,
        /// Speed to the left, m/s.
        pub lateral: f64,
        /// Turn rate, rad/s, positive to the left.
        pub angular: f64,
    }
}

struct_layout! {
    /// A sector of directions of translation in the robot frame.
    struct Sector {
        /// Direction of the center, rad, positive to the left.
        pub center_rad: f64,
        /// Half of the opening angle, rad; pi or more covers every direction.
        pub half_width_rad: f64,
    }
}

const _: () = assert!(size_of::<Name>() == 32 && size_of::<Note>() == 64);

impl Layout {
    /// Size, bytes.
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
