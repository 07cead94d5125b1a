//! Lights for the card and for the ideal.

use crate::card::Card;
use vg500_engine::ideal::shading::{Light, Lighting};
use vg500_regs::memory::Table;

pub type Vector = [f64; 3];

pub fn dot(a: Vector, b: Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub fn unit(vector: Vector) -> Vector {
    vector.map(|component| component / dot(vector, vector).sqrt())
}

/// Lights, and what a card needs of them.
#[derive(Clone, Debug)]
pub struct Lit {
    pub lighting: Lighting,
    /// Direction towards the eye in voxel space.
    pub eye: Vector,
}

impl Lit {
    /// `axes` are the world vectors of one voxel along each object axis; `eye` is a direction in voxel space.
    pub fn new(lights: Vec<Light>, exponent: f64, eye: Vector, axes: [Vector; 3]) -> Self {
        let in_world = unit([0, 1, 2].map(|row| (0..3).map(|axis| axes[axis][row] * eye[axis]).sum()));
        Self { lighting: Lighting::new(lights, exponent, in_world, axes), eye: unit(eye) }
    }

    /// The eye register.
    pub fn register(&self) -> [i16; 3] {
        self.eye.map(|component| (component * 32768.0).round().clamp(-32767.0, 32767.0) as i16)
    }

    /// What the specular map must hold for a reflection vector in voxel space: it comes of the gradient half-way
    /// to the eye.
    pub fn specular(&self, reflected: Vector) -> f64 {
        let reflected = unit(reflected);
        self.lighting.intensities([0, 1, 2].map(|axis| reflected[axis] + self.eye[axis]))[1]
    }

    pub fn diffuse(&self, gradient: Vector) -> f64 {
        self.lighting.intensities(gradient)[0]
    }

    /// Fills the reflectance maps.
    pub fn load(&self, card: &mut Card) {
        let byte = |intensity: f64| (intensity * 255.0).round() as u8;
        card.set_map(Table::Diffuse, |vertex| byte(self.diffuse(vertex.map(f64::from))));
        card.set_map(Table::Specular, |vertex| byte(self.specular(vertex.map(f64::from))));
    }
}
