//! A world made ready to be seen, heard and touched.

pub(crate) mod build;
mod figure;
mod light;
mod surface;
mod texture;
mod walker;

use parry3d::shape::TriMesh;
use thiserror::Error;

use yamabico_core::parameters::Problems;

use crate::world::World;
use build::Building;
use figure::Facet;
use light::Lighting;

pub use figure::PERSON_RADIUS_M;
pub(crate) use light::glam;
pub use surface::{LightGrid, Material, Solid, Surface};
pub(crate) use texture::Speckle;
pub use walker::{Place, Walker};

/// The building, its light, and its people at one instant.
#[derive(Clone)]
pub struct Scene {
    surfaces: Vec<Surface>,
    light: Vec<f32>,
    solids: Vec<Solid>,
    lighting: Lighting,
    speckle: Speckle,
    building_mesh: TriMesh,
    people_mesh: Option<TriMesh>,
    walkers: Vec<Walker>,
    places: Vec<Place>,
    fixed_surfaces: usize,
    fixed_light: usize,
    time_s: f64,
}

/// Why a scene could not be built.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The world has values out of range.
    #[error(transparent)]
    World(#[from] Problems),
    /// The world's surfaces do not make a mesh.
    #[error("the world has no usable surfaces: {0}")]
    Mesh(String),
}

impl Scene {
    /// Builds the world for the run of `seed` (which moves only what the world lets it: boxes and the people's start), at time 0.
    ///
    /// # Errors
    /// [`SceneError`] for a world with values out of range.
    pub fn new(world: &World, seed: u64) -> Result<Self, SceneError> {
        world.check()?;
        let mut building = Building::new(world, seed);
        let building_mesh = mesh(&building.surfaces)?;
        let lighting = Lighting {
            emitters: std::mem::take(&mut building.emitters),
            ambient: world.ambient.unwrap_or(0.45),
        };
        let mut light = Vec::new();
        lighting.bake(&mut building.surfaces, &building_mesh, &mut light);
        let walkers = world.people.iter().enumerate().map(|(i, p)| Walker::new(p, i, seed)).collect();
        let mut scene = Self {
            fixed_surfaces: building.surfaces.len(),
            fixed_light: light.len(),
            surfaces: building.surfaces,
            light,
            solids: building.solids,
            lighting,
            speckle: Speckle::new(world.texture_seed),
            building_mesh,
            people_mesh: None,
            walkers,
            places: Vec::new(),
            time_s: f64::NAN,
        };
        scene.set_time(0.0)?;
        Ok(scene)
    }

    /// Moves the people to where they are `time_s` seconds after the start of the run.
    ///
    /// # Errors
    /// [`SceneError::Mesh`] when a person's figure is degenerate.
    pub fn set_time(&mut self, time_s: f64) -> Result<(), SceneError> {
        if self.time_s == time_s {
            return Ok(());
        }
        self.time_s = time_s;
        self.surfaces.truncate(self.fixed_surfaces);
        self.light.truncate(self.fixed_light);
        self.places.clear();
        let mut facets: Vec<Facet> = Vec::new();
        for walker in &self.walkers {
            let place = walker.at(time_s);
            figure::facets(&walker.person, &place, &mut facets);
            self.places.push(place);
        }
        for Facet { mut surface, outward } in facets {
            surface.light = LightGrid { first: self.light.len(), count: [2, 2] };
            for v in [0.0, surface.size[1]] {
                for (u, normal) in [0.0, surface.size[0]].into_iter().zip(outward) {
                    self.light.push(self.lighting.at(surface.point(u, v), normal, None));
                }
            }
            self.surfaces.push(surface);
        }
        let figures = &self.surfaces[self.fixed_surfaces..];
        self.people_mesh = if figures.is_empty() { None } else { Some(mesh(figures)?) };
        Ok(())
    }

    /// The instant that the people are shown at, seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// All surfaces, the building's first.
    #[must_use]
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Where walls, doors and boxes meet the floor: two points each, x and y in meters.
    #[must_use]
    pub fn floor_plan(&self) -> Vec<Vec<[f64; 2]>> {
        let foot = |surface: &Surface| -> Option<Vec<[f64; 2]>> {
            let on_floor: Vec<_> = surface.corners.iter().filter(|corner| corner.z < 0.01).collect();
            (on_floor.len() == 2).then(|| on_floor.iter().map(|corner| [corner.x, corner.y]).collect())
        };
        self.surfaces.iter().filter_map(foot).collect()
    }

    /// What can be run into, people apart.
    #[must_use]
    pub fn solids(&self) -> &[Solid] {
        &self.solids
    }

    /// The people's ways.
    #[must_use]
    pub fn walkers(&self) -> &[Walker] {
        &self.walkers
    }

    /// Lets the people look where they go, from `from_s` to `to_s`: a body of `radius_m` is at `center`.
    pub fn give_way(&mut self, center: [f64; 2], radius_m: f64, from_s: f64, to_s: f64) {
        self.walkers.iter_mut().for_each(|walker| walker.give_way(center, radius_m, from_s, to_s));
    }

    /// Where the people are.
    #[must_use]
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    pub(crate) fn light(&self) -> &[f32] {
        &self.light
    }

    pub(crate) fn speckle(&self) -> &Speckle {
        &self.speckle
    }

    /// The building without people.
    pub(crate) fn building(&self) -> &TriMesh {
        &self.building_mesh
    }

    /// Meshes with two triangles a surface, and the index of their first surface.
    pub(crate) fn meshes(&self) -> impl Iterator<Item = (&TriMesh, usize)> {
        std::iter::once((&self.building_mesh, 0))
            .chain(self.people_mesh.iter().map(|m| (m, self.fixed_surfaces)))
    }
}

fn mesh(surfaces: &[Surface]) -> Result<TriMesh, SceneError> {
    let vertices = surfaces.iter().flat_map(|s| s.corners.map(glam)).collect();
    let indices = (0..surfaces.len() as u32)
        .flat_map(|i| [[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]])
        .collect();
    TriMesh::new(vertices, indices).map_err(|e| SceneError::Mesh(e.to_string()))
}
