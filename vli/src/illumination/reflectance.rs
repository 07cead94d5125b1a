use super::Light;
use glam::{DMat3, DVec3};
use vg500_regs::limit::REFLECTANCE_ENTRIES;
use vg500_regs::number::EYE;
use vg500_regs::reflectance::direction;

/// A reflectance map: intensities 0..=255 of all entries.
pub type ReflectanceMap = [u8; REFLECTANCE_ENTRIES];

/// Relative difference of squared axis lengths, and cosine between axes, below which a volume counts as isotropic.
const ISOTROPIC: f64 = 1e-9;

/// The diffuse map of a volume with the linear part `model` of its model matrix (voxel to world, invertible).
///
/// Surfaces face where values fall, so the normal is the negative gradient; a light of direction d gives
/// max(0, -n . d). Lights add, up to full intensity.
#[must_use]
pub fn diffuse_map(model: DMat3, lights: &[Light]) -> ReflectanceMap {
    let world_from_gradient = model.inverse().transpose();
    fill(|gradient| {
        let normal = -(world_from_gradient * gradient).normalize_or_zero();
        sum(lights, |light| normal.dot(-light.direction()).max(0.0))
    })
}

/// The specular map for highlights of Phong exponent `exponent`, as seen by an eye in direction `eye` (world space,
/// unit length).
///
/// In an isotropic volume the card's reflection vector is the true one but for a rotation, and the map does not
/// depend on the eye. Otherwise each entry's reflection vector is taken back to the gradient that it comes from,
/// half-way between it and the eye vector, and that gradient is reflected in world space.
#[must_use]
pub fn specular_map(model: DMat3, lights: &[Light], exponent: f64, eye: DVec3) -> ReflectanceMap {
    let highlight = |reflected: DVec3| {
        sum(lights, |light| match reflected.dot(-light.direction()) {
            cosine if cosine > 0.0 => libm::pow(cosine.min(1.0), exponent),
            _ => 0.0,
        })
    };
    if is_isotropic(model) {
        return fill(|reflected| highlight((model * reflected).normalize_or_zero()));
    }
    let world_from_gradient = model.inverse().transpose();
    let object_eye = object_eye(model, eye);
    fill(|reflected| {
        let gradient = reflected.normalize_or_zero() + object_eye;
        let normal = (world_from_gradient * gradient).normalize_or_zero();
        highlight(2.0 * normal.dot(eye) * normal - eye)
    })
}

/// The registers' eye vector for an eye in direction `eye` (world space, unit length): its direction in voxel
/// space, so that gradients across the line of sight stay so. Components are odd, which keeps the card's products
/// free of ties.
#[must_use]
pub fn eye_vector(model: DMat3, eye: DVec3) -> [i16; 3] {
    let scale = f64::from(1_u32 << EYE.fraction);
    object_eye(model, eye).to_array().map(|component| {
        let odd = (component.abs() * scale / 2.0).floor() * 2.0 + 1.0;
        odd.min(scale - 1.0).copysign(component) as i16
    })
}

fn object_eye(model: DMat3, eye: DVec3) -> DVec3 {
    (model.inverse() * eye).normalize_or_zero()
}

fn is_isotropic(model: DMat3) -> bool {
    let gram = model.transpose() * model;
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    let difference = gram - DMat3::from_diagonal(DVec3::splat(mean));
    difference.to_cols_array().iter().all(|entry| entry.abs() <= ISOTROPIC * mean)
}

fn sum(lights: &[Light], part: impl Fn(&Light) -> f64) -> f64 {
    lights.iter().map(|light| light.intensity() * part(light)).sum()
}

fn fill(intensity: impl Fn(DVec3) -> f64) -> ReflectanceMap {
    core::array::from_fn(|entry| {
        let [x, y, z] = direction(entry).map(f64::from);
        (intensity(DVec3::new(x, y, z)).min(1.0) * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(x: f64, y: f64, z: f64) -> Light {
        Light::new(DVec3::new(x, y, z), 1.0).unwrap()
    }

    fn rotation() -> DMat3 {
        DMat3::from_cols(DVec3::new(0.6, 0.8, 0.0), DVec3::new(-0.8, 0.6, 0.0), DVec3::Z)
    }

    #[test]
    fn surfaces_that_face_the_light_are_bright() {
        let map = diffuse_map(DMat3::IDENTITY, &[light(0.0, 0.0, -1.0)]);
        // Light travels along -z; values that fall along +z have gradients along -z (face 5).
        let brightest = map.iter().max().unwrap();
        assert!(map[5 * 64..].contains(brightest) && *brightest > 245);
        assert!(map[4 * 64..5 * 64].iter().all(|&intensity| intensity == 0));
    }

    #[test]
    fn lights_add_up_to_full_intensity() {
        let one = Light::new(DVec3::NEG_Z, 0.4).unwrap();
        let map = |count| diffuse_map(DMat3::IDENTITY, &vec![one; count]);
        let at = 5 * 64 + 3 * 8 + 3;
        assert!(map(2)[at].abs_diff(2 * map(1)[at]) <= 1);
        assert_eq!(map(9)[at], 255);
        assert_eq!(diffuse_map(DMat3::IDENTITY, &[]), [0; REFLECTANCE_ENTRIES]);
    }

    #[test]
    fn moving_the_eye_changes_no_map_of_an_isotropic_volume() {
        let lights = [light(1.0, -2.0, -3.0)];
        let model = rotation() * 0.7;
        let first = specular_map(model, &lights, 20.0, DVec3::Z);
        for eye in [DVec3::X, DVec3::new(0.48, 0.6, 0.64), DVec3::new(-0.6, 0.0, 0.8)] {
            assert_eq!(specular_map(model, &lights, 20.0, eye), first);
        }
    }

    #[test]
    fn taking_reflections_back_agrees_with_the_direct_way() {
        let lights = [light(1.0, -2.0, -3.0)];
        let direct = specular_map(rotation(), &lights, 5.0, DVec3::Z);
        let barely_anisotropic = rotation() * DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1.0 + 1e-7));
        let taken_back = specular_map(barely_anisotropic, &lights, 5.0, DVec3::new(0.48, 0.6, 0.64));
        assert!(direct.iter().zip(taken_back).all(|(a, b)| a.abs_diff(b) <= 1));
    }

    #[test]
    fn anisotropic_maps_show_the_true_normal() {
        // Voxels are flat: spacing 1, 1, 4. A gradient (1, 0, 1) in voxels is (1, 0, 1/4) in the world.
        let model = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 4.0));
        let map = diffuse_map(model, &[light(1.0, 0.0, 0.0)]);
        let entry = 4 * 64 + 3 * 8 + 7; // +z face, u = 7: direction (7, -1, 7)
        let world = DVec3::new(7.0, -1.0, 7.0 / 4.0).normalize();
        assert_eq!(f64::from(map[entry]), (world.x * 255.0).round());
    }

    #[test]
    fn the_eye_vector_is_unit_odd_and_symmetric() {
        let model = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 2.0));
        for eye in [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.48, 0.6, -0.64)] {
            let words = eye_vector(model, eye);
            let length: f64 = words.iter().map(|&word| (f64::from(word) / 32768.0).powi(2)).sum();
            assert!((length - 1.0).abs() < 1.0 / 4096.0, "{words:?}");
            assert!(words.iter().all(|word| word % 2 != 0));
            assert_eq!(eye_vector(model, -eye), words.map(|word| -word));
        }
    }
}
