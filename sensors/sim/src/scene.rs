//! Scene: the surfaces, solids, light and people of a world, for rendering, ray casting and collisions.

pub(crate) mod build;
mod decoration;
mod figure;
mod light;
mod surface;
mod texture;
mod walker;

use parry3d::shape::TriMesh;
use thiserror::Error;

use yamabico_core::parameters::Problems;

use crate::world::{Grain, World};
use build::Parts;
use figure::Facet;
use light::Lighting;

pub use figure::PERSON_RADIUS_M;
pub(crate) use light::glam;
pub use surface::{LightGrid, Material, Solid, Surface, Tiles};
pub(crate) use texture::Texture;
pub use walker::{PersonPose, Walker};

/// Building with its light, and people at one time.
#[derive(Clone)]
pub struct Scene {
    surfaces: Vec<Surface>,
    light: Vec<f32>,
    solids: Vec<Solid>,
    lighting: Lighting,
    speckle: Texture,
    /// Texture of the floor, if it is not speckled.
    floor_texture: Option<Texture>,
    building_mesh: TriMesh,
    people_mesh: Option<TriMesh>,
    walkers: Vec<Walker>,
    people: Vec<PersonPose>,
    /// Number of surfaces of the building; those of people follow.
    fixed_surfaces: usize,
    /// Number of light values of the building; those of people follow.
    fixed_light: usize,
    time_s: f64,
}

/// Error from building a scene.
#[derive(Debug, Error)]
pub enum SceneError {
    /// Values of the world are out of range.
    #[error(transparent)]
    World(#[from] Problems),
    /// The surfaces of the world do not form a mesh.
    #[error("the surfaces of the world form no valid mesh: {0}")]
    Mesh(String),
}

impl Scene {
    /// Builds the scene at time 0. The seed draws the jitter of boxes and of the people's start that the world allows.
    ///
    /// # Errors
    /// [`SceneError`] if values of the world are out of range.
    pub fn new(world: &World, seed: u64) -> Result<Self, SceneError> {
        world.check()?;
        let mut building = Parts::new(world, seed);
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
            speckle: Texture::new(Grain::Speckle, world.texture_seed),
            floor_texture: Some(world.floor.grain)
                .filter(|grain| *grain != Grain::Speckle)
                .map(|grain| Texture::new(grain, world.texture_seed)),
            building_mesh,
            people_mesh: None,
            walkers,
            people: Vec::new(),
            time_s: f64::NAN,
        };
        scene.set_time(0.0)?;
        Ok(scene)
    }

    /// Moves the people to their poses `time_s` seconds after the start of the run.
    ///
    /// # Errors
    /// [`SceneError::Mesh`] if the surfaces of a person are degenerate.
    pub fn set_time(&mut self, time_s: f64) -> Result<(), SceneError> {
        if self.time_s == time_s {
            return Ok(());
        }
        self.time_s = time_s;
        self.surfaces.truncate(self.fixed_surfaces);
        self.light.truncate(self.fixed_light);
        self.people.clear();
        let mut facets: Vec<Facet> = Vec::new();
        for walker in &self.walkers {
            let pose = walker.at(time_s);
            figure::facets(&walker.person, &pose, &mut facets);
            self.people.push(pose);
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

    /// Returns the time for which the people are shown, s after the start of the run.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Returns all surfaces: those of the building, then those of people.
    #[must_use]
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Returns the lines where walls, doors and boxes meet the floor: two points each, x and y in the world frame, m.
    #[must_use]
    pub fn floor_plan(&self) -> Vec<Vec<[f64; 2]>> {
        let foot = |surface: &Surface| -> Option<Vec<[f64; 2]>> {
            let on_floor: Vec<_> = surface.corners.iter().filter(|corner| corner.z < 0.01).collect();
            (on_floor.len() == 2).then(|| on_floor.iter().map(|corner| [corner.x, corner.y]).collect())
        };
        self.surfaces.iter().filter_map(foot).collect()
    }

    /// Returns the obstacles other than people.
    #[must_use]
    pub fn solids(&self) -> &[Solid] {
        &self.solids
    }

    /// Returns the walks of the people.
    #[must_use]
    pub fn walkers(&self) -> &[Walker] {
        &self.walkers
    }

    /// Lets people wait for a robot of this radius at `center` (m) from `from_s` to `to_s`, see [`Walker::give_way`].
    pub fn give_way(&mut self, center: [f64; 2], radius_m: f64, from_s: f64, to_s: f64) {
        self.walkers.iter_mut().for_each(|walker| walker.give_way(center, radius_m, from_s, to_s));
    }

    /// Returns the current poses of the people.
    #[must_use]
    pub fn people(&self) -> &[PersonPose] {
        &self.people
    }

    pub(crate) fn light(&self) -> &[f32] {
        &self.light
    }

    /// Returns the fine texture of this shape; only the floor has others than speckle.
    pub(crate) fn texture(&self, grain: Grain) -> &Texture {
        self.floor_texture.as_ref().filter(|_| grain != Grain::Speckle).unwrap_or(&self.speckle)
    }

    /// Returns true if the mirror image in the floor is sharp.
    pub(crate) fn mirrors_sharply(&self) -> bool {
        self.surfaces[..self.fixed_surfaces].iter().any(|s| s.material.gloss > 0.0 && s.material.is_sharp)
    }

    /// Returns the mesh of the building, without people.
    pub(crate) fn building(&self) -> &TriMesh {
        &self.building_mesh
    }

    /// Returns the meshes, with two triangles per surface, and the index of their first surface.
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
