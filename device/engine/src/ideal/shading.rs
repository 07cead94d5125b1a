//! Illumination in arithmetic: what reflectance maps and the gradient-magnitude table approximate.

use super::PiecewiseLinear;

/// How samples are illuminated.
#[derive(Clone, Debug, PartialEq)]
pub struct Shading {
    /// Emission coefficient ke, 0..=1.
    pub emissive: f64,
    /// What light adds, if there is any.
    pub phong: Option<Phong>,
    /// What the gradient magnitude modulates, unless that is nothing.
    pub modulation: Option<Modulation>,
}

/// Phong reflection.
#[derive(Clone, Debug, PartialEq)]
pub struct Phong {
    /// Diffuse coefficient kd, 0..=1.
    pub diffuse: f64,
    /// Specular coefficient ks, 0..=1.
    pub specular: f64,
    /// Colour of highlights, 0..=1 each.
    pub specular_color: [f64; 3],
    /// The lights.
    pub lighting: Lighting,
}

/// Modulation by the gradient magnitude.
#[derive(Clone, Debug, PartialEq)]
pub struct Modulation {
    /// Factor, 0..=1, of a magnitude in the unit of [`Scene::gradient`](super::Scene::gradient).
    pub function: PiecewiseLinear<1>,
    /// Whether it scales opacity (in alpha blending and sums).
    pub opacity: bool,
    /// Whether it scales diffuse illumination.
    pub diffuse: bool,
    /// Whether it scales specular illumination.
    pub specular: bool,
}

/// A directional light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Direction in which it travels, world space, unit length.
    pub direction: [f64; 3],
    /// Intensity, 0..=1.
    pub intensity: f64,
}

/// Lights, and how a volume lies in them.
#[derive(Clone, Debug, PartialEq)]
pub struct Lighting {
    lights: Vec<Light>,
    exponent: f64,
    eye: [f64; 3],
    /// L^-T: world gradients of unit gradients along the object axes.
    reciprocal: [[f64; 3]; 3],
}

impl Shading {
    /// Every sample has its own colour.
    pub const UNLIT: Self = Self { emissive: 1.0, phong: None, modulation: None };

    /// Whether gradients matter.
    #[must_use]
    pub const fn needs_gradient(&self) -> bool {
        self.phong.is_some() || self.modulation.is_some()
    }

    /// Colour and opacity, before any cut, of a sample with `gradient`:
    /// (ke + Id Gd kd) color + Is Gs ks SpecularColor, clamped, and Go alpha.
    #[must_use]
    pub fn shade(&self, [r, g, b, alpha]: [f64; 4], gradient: [f64; 3]) -> [f64; 4] {
        let factors = self.modulation.as_ref().map_or([1.0; 3], |modulation| modulation.factors(gradient));
        let [opacity, diffuse, specular] = factors;
        let mut color = [r, g, b].map(|channel| channel * self.emissive);
        if let Some(phong) = &self.phong {
            let light = phong.lighting.intensities(gradient);
            let body = light[0] * diffuse * phong.diffuse;
            let highlight = light[1] * specular * phong.specular;
            for (channel, (own, white)) in
                color.iter_mut().zip([r, g, b].into_iter().zip(phong.specular_color))
            {
                *channel += body * own + highlight * white;
            }
        }
        let [r, g, b] = color.map(|channel| channel.min(1.0));
        [r, g, b, alpha * opacity]
    }
}

impl Modulation {
    /// Factors of opacity, diffuse and specular illumination.
    fn factors(&self, gradient: [f64; 3]) -> [f64; 3] {
        let [factor] = self.function.at(dot(gradient, gradient).sqrt());
        let factor = factor.clamp(0.0, 1.0);
        [self.opacity, self.diffuse, self.specular].map(|modulated| if modulated { factor } else { 1.0 })
    }
}

impl Lighting {
    /// `lights` and an eye in direction `eye` (world space, unit length); highlights have Phong exponent
    /// `exponent`. `axes` are the world vectors of one voxel along each object axis, linearly independent.
    #[must_use]
    pub fn new(lights: Vec<Light>, exponent: f64, eye: [f64; 3], axes: [[f64; 3]; 3]) -> Self {
        let [x, y, z] = axes;
        let volume = dot(cross(x, y), z);
        let reciprocal = [cross(y, z), cross(z, x), cross(x, y)].map(|axis| scaled(axis, 1.0 / volume));
        Self { lights, exponent, eye, reciprocal }
    }

    /// Diffuse and specular intensity, 0..=1, on a sample with `gradient` (object axes, any unit). Without a
    /// gradient there is no light.
    ///
    /// Surfaces face where values fall. Each light shines on one side: max(0, n . l), and max(0, r . l)^exponent
    /// with r = 2 (n . e) n - e; lights add up to full intensity.
    #[must_use]
    pub fn intensities(&self, gradient: [f64; 3]) -> [f64; 2] {
        let normal = [0, 1, 2].map(|axis| -dot(gradient, self.reciprocal.map(|column| column[axis])));
        let length = dot(normal, normal).sqrt();
        if length == 0.0 {
            return [0.0; 2];
        }
        let normal = scaled(normal, 1.0 / length);
        let along = 2.0 * dot(normal, self.eye);
        let reflected = [0, 1, 2].map(|axis| along * normal[axis] - self.eye[axis]);
        let sum = |part: &dyn Fn(f64) -> f64, vector: [f64; 3]| {
            let parts = self.lights.iter().map(|light| (-dot(vector, light.direction), light.intensity));
            let lit = parts.filter(|(cosine, _)| *cosine > 0.0);
            lit.map(|(cosine, intensity)| intensity * part(cosine.min(1.0))).sum::<f64>().min(1.0)
        };
        [sum(&|cosine| cosine, normal), sum(&|cosine| libm::pow(cosine, self.exponent), reflected)]
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn cross([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> [f64; 3] {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

fn scaled(vector: [f64; 3], factor: f64) -> [f64; 3] {
    vector.map(|component| component * factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const DOWN: Light = Light { direction: [0.0, 0.0, -1.0], intensity: 1.0 };

    fn head_light(exponent: f64, axes: [[f64; 3]; 3]) -> Lighting {
        Lighting::new(vec![DOWN], exponent, [0.0, 0.0, 1.0], axes)
    }

    fn close(found: [f64; 2], expected: [f64; 2]) {
        let error = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-12, "{found:?} {expected:?}");
    }

    #[test]
    fn surfaces_face_where_values_fall() {
        let light = head_light(4.0, CUBES);
        close(light.intensities([0.0, 0.0, -9.0]), [1.0, 1.0]);
        // From behind nothing is diffuse; the reflection does not know the sides of a surface.
        close(light.intensities([0.0, 0.0, 9.0]), [0.0, 1.0]);
        close(light.intensities([0.0; 3]), [0.0; 2]);
        // 60 degrees: cosine 1/2, and 120 degrees between reflection and light.
        close(light.intensities([0.75_f64.sqrt(), 0.0, -0.5]), [0.5, 0.0]);
        // 30 degrees: the reflection is 60 degrees off, (1/2)^4.
        close(light.intensities([-0.5, 0.0, -(0.75_f64.sqrt())]), [0.75_f64.sqrt(), 0.0625]);
    }

    #[test]
    fn lights_add_up_to_full_intensity() {
        let dim = Light { intensity: 0.4, ..DOWN };
        let aside = Light { direction: [1.0, 0.0, 0.0], intensity: 0.5 };
        let of = |lights: Vec<Light>| {
            Lighting::new(lights, 1.0, [0.0, 0.0, 1.0], CUBES).intensities([-0.6, 0.0, -0.8])
        };
        // n = (0.6, 0, 0.8); r = 1.6 n - e = (0.96, 0, 0.28); towards the second light is (-1, 0, 0).
        close(of(vec![dim]), [0.32, 0.112]);
        close(of(vec![dim, dim, aside]), [0.64, 0.224]);
        close(of(vec![DOWN, DOWN]), [1.0, 0.56]);
        close(of(vec![]), [0.0; 2]);
    }

    #[test]
    fn normals_are_those_of_the_world() {
        // Voxels of 1 x 1 x 4: a gradient of (-1, 0, -1) per voxel is (-1, 0, -1/4) in the world.
        let flat = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 4.0]];
        let cosine = 0.25 / (1.0_f64 + 0.0625).sqrt();
        assert!((head_light(1.0, flat).intensities([-1.0, 0.0, -1.0])[0] - cosine).abs() < 1e-12);
        // Slices are shifted along y by half their distance: values that fall along world z alone fall by 1 a
        // slice, and not within slices.
        let sheared = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.5, 1.0]];
        close(head_light(9.0, sheared).intensities([0.0, 0.0, -1.0]), [1.0, 1.0]);
        // Values that fall along world y alone: by 1 a row, and by 1/2 a slice.
        close(head_light(9.0, sheared).intensities([0.0, -1.0, -0.5]), [0.0, 0.0]);
        // A mirrored volume.
        let mirrored = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        close(head_light(1.0, mirrored).intensities([0.0, 0.0, 1.0]), [1.0, 1.0]);
    }

    fn lit() -> Shading {
        let phong = Phong {
            diffuse: 0.5,
            specular: 0.25,
            specular_color: [1.0, 0.5, 0.0],
            lighting: head_light(1.0, CUBES),
        };
        Shading { emissive: 0.2, phong: Some(phong), modulation: None }
    }

    fn shaded(shading: &Shading, color: [f64; 4], expected: [f64; 4]) {
        let found = shading.shade(color, [0.0, 3.0, -4.0]);
        let error = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-12, "{found:?} {expected:?}");
    }

    // The normal of (0, 3, -4) is (0, -0.6, 0.8): diffuse 0.8, specular 2 * 0.64 - 1 = 0.28.

    #[test]
    fn emission_and_light_add_and_only_the_sum_is_clamped() {
        shaded(&lit(), [0.4, 0.2, 1.0, 0.3], [0.6 * 0.4 + 0.07, 0.6 * 0.2 + 0.035, 0.6, 0.3]);
        let bright = Shading { emissive: 1.0, ..lit() };
        shaded(&bright, [0.9, 0.5, 0.0, 0.3], [1.0, 0.7 + 0.035, 0.0, 0.3]);
        let dark = lit().shade([0.5, 1.0, 0.0, 1.0], [0.0; 3]);
        assert_eq!(dark, [0.1, 0.2, 0.0, 1.0], "without a gradient there is emission only");
    }

    #[test]
    fn modulation_dims_what_it_is_asked_to() {
        let modulated = |points, [opacity, diffuse, specular]: [bool; 3]| {
            let function = PiecewiseLinear::new(points).unwrap();
            Shading { modulation: Some(Modulation { function, opacity, diffuse, specular }), ..lit() }
        };
        let half = |what| modulated(vec![(0.0, [0.0]), (10.0, [1.0])], what); // |g| = 5
        let color = [1.0, 0.0, 1.0, 1.0];
        shaded(&half([false; 3]), color, [0.67, 0.035, 0.6, 1.0]);
        shaded(&half([true, false, false]), color, [0.67, 0.035, 0.6, 0.5]);
        shaded(&half([false, true, false]), color, [0.47, 0.035, 0.4, 1.0]);
        shaded(&half([false, false, true]), color, [0.635, 0.0175, 0.6, 1.0]);
        let steep = modulated(vec![(0.0, [-3.0]), (5.0, [7.0])], [true; 3]);
        shaded(&steep, color, [0.67, 0.035, 0.6, 1.0]);
    }
}
