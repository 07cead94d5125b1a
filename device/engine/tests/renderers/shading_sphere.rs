//! A shaded sphere, of which everything is known: the renderers against Phong's formula.
//!
//! Values fall by s for each millimetre outwards, f = 2048 + s (R - r), and a shell around the surface can be seen. With
//! L the model matrix and l the lengths of its columns, the normal is x / r, and the gradient in voxels is
//! -s L^T x / r. The second derivatives of r are at most 1 / r, the third ones at most 2 / sqrt(3) / r^2; rho is the
//! least radius among the voxels that a sample of the shell and its gradient are made of.
//!
//! * Trilinear interpolation is off by at most sum of l^2 / 8 s / rho.
//! * The difference of two voxels along axis a is off 2 df by at most l_a^3 / 3 of a third derivative, its
//!   interpolation by the sum of l_b^2 / 8 times 2 l_a third derivatives: U l_a (l_a^2 / 3 + sum of l_b^2 / 4), with
//!   U = 2 / sqrt(3) s / rho^2.
//! * A shift of the position by d voxels moves the value by at most s sum of l d, and the difference by
//!   2 s l_a sum of l d / rho.
//! * Voxels of 12 bits are off by 1/2, differences of them by 1.
//!
//! The maps hold the formula at each vertex, so what they show between vertices is what their resolution can.
//!
//! For the ideal with voxels in `f64` only the first two count. For the reference all of them, and then the errors
//! that [`bounds`](crate::bounds) derives.

use crate::bounds::truth::{IDEAL_UNIT, Rounding, Truth};
use crate::bounds::{compare_with, task};
use crate::card::Card;
use crate::grid::Grid;
use crate::lit::{Lit, Vector, dot, unit};
use crate::scene::{Scene, UNLIT, VOXEL};
use vg500_engine::frame::Illumination;
use vg500_engine::ideal::shading::Light;
use vg500_engine::ideal::{self, Ray};
use vg500_regs::limit::REFLECTANCE_ENTRIES;
use vg500_regs::memory::Table;
use vg500_regs::reflectance::direction;
use vg500_regs::{BlendMode, Permutation, SharedView, VoxelFormat};

const MIDDLE: f64 = 2048.0;
const LIGHTS: [Light; 2] = [
    Light { direction: [0.48, 0.6, 0.64], intensity: 0.7 },
    Light { direction: [-0.8, 0.0, 0.6], intensity: 0.4 },
];
const EXPONENT: f64 = 4.0;
const MATERIAL: Illumination =
    Illumination { emissive: 20, diffuse: 180, specular: 60, specular_color: [255, 255, 128], ..UNLIT };

/// A sphere in voxels of any shape.
struct Sphere {
    /// World vectors of one voxel along each axis, and their lengths.
    axes: [Vector; 3],
    lengths: Vector,
    size: [usize; 3],
    radius: f64,
    /// s, per millimetre.
    steepness: f64,
    /// Half the thickness of the shell in values.
    shell: f64,
}

impl Sphere {
    fn new(axes: [Vector; 3], radius: f64) -> Self {
        let lengths = axes.map(|axis| dot(axis, axis).sqrt());
        // From a sample to the farthest voxel that its gradient is made of.
        let reach = lengths.iter().sum::<f64>() + lengths.iter().copied().fold(0.0, f64::max);
        let steepness = (1600.0 / reach).min(300.0);
        let shell = (1900.0 - steepness * reach).min(600.0);
        let mut sphere = Self { axes, lengths, size: [0; 3], radius, steepness, shell };
        // The box of the sphere: the reciprocal of an axis says how far it reaches along it.
        let margin = radius + shell / steepness + 1.0;
        sphere.size = [0, 1, 2].map(|axis| {
            let reciprocal = sphere.reciprocal(axis);
            2 * (margin * dot(reciprocal, reciprocal).sqrt()).ceil() as usize + 4
        });
        sphere
    }

    /// World gradient of a coordinate in voxels.
    fn reciprocal(&self, axis: usize) -> Vector {
        let [b, c] = [self.axes[(axis + 1) % 3], self.axes[(axis + 2) % 3]];
        let across = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        across.map(|component| component / dot(across, self.axes[axis]))
    }

    /// World position of a voxel position, from the centre.
    fn world(&self, position: Vector) -> Vector {
        let place = [0, 1, 2].map(|axis| position[axis] - (self.size[axis] - 1) as f64 / 2.0);
        [0, 1, 2].map(|row| (0..3).map(|axis| self.axes[axis][row] * place[axis]).sum())
    }

    fn value(&self, position: Vector) -> f64 {
        let world = self.world(position);
        MIDDLE + self.steepness * (self.radius - dot(world, world).sqrt())
    }

    /// In the card's unit.
    fn gradient(&self, position: Vector) -> Vector {
        let normal = unit(self.world(position));
        self.axes.map(|axis| -2.0 * self.steepness * dot(axis, normal) * IDEAL_UNIT)
    }

    /// rho.
    fn least_radius(&self) -> f64 {
        let reach = self.lengths.iter().sum::<f64>() + self.lengths.iter().copied().fold(0.0, f64::max);
        self.radius - self.shell / self.steepness - reach
    }

    fn squares(&self) -> f64 {
        dot(self.lengths, self.lengths)
    }

    fn value_error(&self) -> f64 {
        self.squares() / 8.0 * self.steepness / self.least_radius()
    }

    fn difference_error(&self) -> Vector {
        let third = 2.0 / 3.0_f64.sqrt() * self.steepness / self.least_radius().powi(2);
        self.lengths.map(|length| third * length * (length * length / 3.0 + self.squares() / 4.0))
    }

    /// What is true of a sample, and how far the reference's may be from it.
    fn truth(&self, position: Vector, rounding: &Rounding, z: usize) -> Truth {
        let shift = self.steepness * dot(self.lengths, rounding.0);
        let own = self.difference_error();
        let differences =
            [0, 1, 2].map(|axis| own[axis] + 2.0 * self.lengths[axis] * shift / self.least_radius() + 1.0);
        let value_error = self.value_error() + shift + 0.5;
        // Far from the shell voxels are clamped; nothing can be seen there.
        let value = self.value(position).clamp(0.0, 4095.0);
        Truth::rounded(value, value_error, self.gradient(position), differences, z)
    }

    /// Whether a sample can be seen, or nearly.
    fn in_shell(&self, position: Vector) -> bool {
        (self.value(position) - MIDDLE).abs() < self.shell
    }

    /// Phong's formula.
    fn phong(&self, position: Vector, eye: Vector, color: [f64; 4]) -> [f64; 4] {
        let level = |byte: u8| f64::from(byte) / 255.0;
        let [diffuse, specular] = intensities(unit(self.world(position)), eye);
        let own = level(MATERIAL.emissive) + diffuse * level(MATERIAL.diffuse);
        let white = specular * level(MATERIAL.specular);
        let [r, g, b] =
            [0, 1, 2].map(|it| (own * color[it] + white * level(MATERIAL.specular_color[it])).min(1.0));
        [r, g, b, color[3]]
    }
}

/// Diffuse and specular light on a surface.
fn intensities(normal: Vector, eye: Vector) -> [f64; 2] {
    let mirrored = [0, 1, 2].map(|axis| 2.0 * dot(normal, eye) * normal[axis] - eye[axis]);
    [(normal, 1.0), (mirrored, EXPONENT)].map(|(vector, exponent)| {
        let parts =
            LIGHTS.map(|light| light.intensity * (-dot(vector, light.direction)).max(0.0).powf(exponent));
        parts.iter().sum::<f64>().min(1.0)
    })
}

/// The maps hold Phong's formula at each vertex: the diffuse one for surfaces of that gradient, the specular one for
/// those of which it is the reflection of the eye, which are half-way to it. `eye` is a direction in voxel space.
fn check_maps(card: &Card, sphere: &Sphere, eye: Vector, eye_in_world: Vector) {
    let normal = |gradient: Vector| {
        let [x, y, z] = [0, 1, 2].map(|axis| sphere.reciprocal(axis));
        unit([0, 1, 2].map(|row| -(x[row] * gradient[0] + y[row] * gradient[1] + z[row] * gradient[2])))
    };
    for entry in 0..REFLECTANCE_ENTRIES {
        let vertex = direction(entry).map(f64::from);
        let [diffuse, _] = intensities(normal(vertex), eye_in_world);
        let (vertex, eye) = (unit(vertex), unit(eye));
        let [_, specular] = intensities(normal([0, 1, 2].map(|it| vertex[it] + eye[it])), eye_in_world);
        for (map, expected) in [(Table::Diffuse, diffuse), (Table::Specular, specular)] {
            let found = f64::from(card.tables[map.offset(0) + 4 * entry]);
            assert!((found - 255.0 * expected).abs() <= 0.5 + 1e-9, "{map:?} {entry}: {found} {expected}");
        }
    }
}

/// Opacity rises to a third in the middle of the shell and falls again; colours change slowly.
fn card(sphere: &Sphere) -> Card {
    let shell = sphere.shell - 100.0;
    Card::with_transfer(|value| {
        let inside = 1.0 - (f64::from(value) - MIDDLE).abs() / shell;
        ([(value >> 4) as u8, 220, 255 - (value >> 5) as u8], (1365.0 * inside.max(0.0)) as u16)
    })
}

fn check(name: &str, axes: [Vector; 3], radius: f64) {
    let sphere = Sphere::new(axes, radius);
    let mut card = card(&sphere);
    let grid = Grid::new(VoxelFormat::Uint12Lower, sphere.size, |at| {
        sphere.value(at.map(|place| place as f64)).round().clamp(0.0, 4095.0) as u16
    });
    let store = card.load(&grid);
    // Along z, and obliquely along x; in both cases the eye is where rays come from.
    let oblique = Scene {
        permutation: Permutation::from_word(0x412).unwrap(),
        step: [VOXEL / 3, VOXEL / 5],
        start: [VOXEL / 7, VOXEL / 9],
        supersampling: 2,
        ..Scene::new(store)
    };
    let views =
        [("along z", Scene::new(store), [0.0, 0.0, -1.0]), ("oblique", oblique, [1.0, -0.4, -2.0 / 3.0])];
    for (view, scene, eye) in views {
        let lit = Lit::new(LIGHTS.to_vec(), EXPONENT, eye, axes);
        lit.load(&mut card);
        let illumination = Illumination { eye: lit.register(), ..MATERIAL };
        let scene = Scene { illumination, ..scene }.with_all_rays();
        let task = task(&mut card, &scene);
        let memory = SharedView::of(&mut card.voxels);
        let ideal = ideal::frame::scene_in_light(&task, memory, lit.lighting.clone()).unwrap();
        check_ideal(&sphere, &ideal);
        let in_world = unit([0, 1, 2].map(|row| (0..3).map(|axis| axes[axis][row] * eye[axis]).sum()));
        check_maps(&card, &sphere, eye, in_world);
        let expected: Vec<Ray> = (0..scene.rays[0] * scene.rays[1])
            .map(|place| {
                let offset = [place % scene.rays[0], place / scene.rays[0]];
                let start = [0, 1].map(|axis| ideal.rays.start[axis] + f64::from(offset[axis]));
                let mut ray = Ray::default();
                for position in ideal.positions(start) {
                    let value = sphere.value(position);
                    let color = || sphere.phong(position, in_world, (ideal.transfer)(value));
                    ray.blend(BlendMode::Alpha, value, color);
                }
                ray
            })
            .collect();
        let rounding = Rounding::of(&scene);
        let z = scene.permutation.axes()[2].axis;
        let truth = |position| sphere.truth(position, &rounding, z);
        let outcome = compare_with(&mut card, &scene, &task, &ideal, &expected, &truth);
        outcome.print(&format!("{name}, {view}"));
        assert!(outcome.compared > 500 && outcome.compared > 100 * outcome.unbounded, "{outcome:?}");
    }
}

/// The ideal of voxels in `f64` against the field.
fn check_ideal<V: ideal::Voxels, T: ideal::Transfer>(sphere: &Sphere, scene: &ideal::Scene<V, T>) {
    let ideal = ideal::Scene {
        size: scene.size,
        voxels: |at: [usize; 3]| sphere.value(at.map(|place| place as f64)),
        transfer: |_| [1.0; 4],
        permutation: scene.permutation,
        rays: scene.rays,
        visibility: scene.visibility,
        cursor: None,
        shading: scene.shading.clone(),
        blend: BlendMode::Alpha,
    };
    let [value_error, difference_error] = [[sphere.value_error(); 3], sphere.difference_error()];
    let mut parts = [0.0_f64; 2];
    for place in 0..ideal.rays.size[0] * ideal.rays.size[1] {
        let offset = [place % ideal.rays.size[0], place / ideal.rays.size[0]].map(f64::from);
        let start = [0, 1].map(|axis| ideal.rays.start[axis] + offset[axis]);
        for position in ideal.positions(start).filter(|position| sphere.in_shell(*position)) {
            let part = (ideal.sample(position) - sphere.value(position)).abs() / value_error[0];
            parts[0] = parts[0].max(part);
            let [found, expected] = [ideal.gradient(position), sphere.gradient(position)];
            for axis in 0..3 {
                let error = (found[axis] - expected[axis]).abs() / IDEAL_UNIT;
                parts[1] = parts[1].max(error / difference_error[axis]);
            }
        }
    }
    println!("ideal: values off by {:.2} of their bound, gradients by {:.2} of theirs", parts[0], parts[1]);
    assert!(parts[1] > 0.0 && parts.iter().all(|part| *part <= 1.0), "{parts:?}");
}

#[test]
fn isotropic_spheres_are_shaded_as_phong_says() {
    check("isotropic", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 20.0);
}

#[test]
fn spheres_of_tall_voxels_are_shaded_as_phong_says() {
    check("spacing 1:2", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]], 28.0);
    check("spacing 1:10", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 10.0]], 70.0);
}

#[test]
fn spheres_of_sheared_voxels_are_shaded_as_phong_says() {
    let tangent = 30.0_f64.to_radians().tan();
    check("sheared by 30 degrees", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, tangent, 1.0]], 20.0);
}
