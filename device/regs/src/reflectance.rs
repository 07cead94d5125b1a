//! Which direction each entry of a reflectance map stands for (paper, section 3.5).
//!
//! Six faces, numbered +x, -x, +y, -y, +z, -z, of 8 x 8 vertices; entry `64 face + 8 v + u`. On a face the other
//! two axes, in increasing order, are u and v. Edges are shared: their vertices stand in both faces.

use crate::limit::REFLECTANCE_ENTRIES;

/// Vertices along a side of a face.
pub const VERTICES: usize = 8;
/// Entries of a face.
pub const FACE: usize = VERTICES * VERTICES;

/// The axes of u and v on the faces of an axis.
#[must_use]
pub const fn face_axes(axis: usize) -> [usize; 2] {
    match axis {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    }
}

/// Direction of an entry in object axes: the face's own axis is +-7, the others -7, -5, ..., 7.
#[must_use]
pub const fn direction(entry: usize) -> [i32; 3] {
    let entry = entry % REFLECTANCE_ENTRIES;
    let face = entry / FACE;
    let [u, v] = face_axes(face / 2);
    let mut direction = [0; 3];
    direction[face / 2] = if face.is_multiple_of(2) { 7 } else { -7 };
    direction[u] = 2 * (entry % VERTICES) as i32 - 7;
    direction[v] = 2 * (entry % FACE / VERTICES) as i32 - 7;
    direction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_and_vertices_stand_where_the_text_says() {
        assert_eq!(direction(0), [7, -7, -7]);
        assert_eq!(direction(FACE + 1), [-7, -5, -7]);
        assert_eq!(direction(2 * FACE + 8), [-7, 7, -5]);
        assert_eq!(direction(5 * FACE + 63), [7, 7, -7]);
    }
}
