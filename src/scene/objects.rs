//! What ids and mattes tell apart: objects, and groups of them.

use super::Scene;

/// The objects of a scene: each single shape, then each cloud, as a whole or row by row.
#[derive(Debug, Clone)]
pub struct Objects {
    singles: u32,
    /// First primitive of each cloud, then one past the last.
    starts: Vec<u32>,
    instances: bool,
}

impl Objects {
    /// With `instances` every primitive is an object of its own, and its number is the primitive's.
    pub fn new(scene: &Scene, instances: bool) -> Self {
        let mut starts = vec![scene.objects.len() as u32];
        for cloud in &scene.clouds {
            starts.push(starts[starts.len() - 1] + cloud.len() as u32);
        }
        Objects { singles: scene.objects.len() as u32, starts, instances }
    }

    /// How many there are.
    pub fn count(&self) -> u32 {
        match self.instances {
            true => self.starts[self.starts.len() - 1],
            false => self.singles + self.starts.len() as u32 - 1,
        }
    }

    /// The object of a primitive.
    #[inline]
    pub fn of(&self, primitive: u32) -> u32 {
        match primitive.checked_sub(self.singles) {
            Some(_) if !self.instances => self.singles + self.cloud(primitive),
            _ => primitive,
        }
    }

    /// The objects of some primitives.
    #[inline(always)]
    pub fn of_all<const N: usize>(&self, primitives: [u32; N]) -> [u32; N] {
        if self.instances {
            return primitives;
        }
        let (mut objects, singles) = (primitives, self.singles);
        if self.starts.len() > 16 {
            (0..N).for_each(|i| objects[i] = self.of(primitives[i]));
            return objects;
        }
        // Few clouds are sooner counted than looked for.
        (0..N).for_each(|i| objects[i] = primitives[i].min(singles));
        for &start in &self.starts[1..] {
            (0..N).for_each(|i| objects[i] += u32::from(start <= primitives[i]));
        }
        objects
    }

    /// The cloud that a primitive past the single shapes is a row of.
    fn cloud(&self, primitive: u32) -> u32 {
        self.starts.partition_point(|start| *start <= primitive) as u32 - 1
    }

    /// What an object is called: by the user, or by its kind and number. Rows of clouds are `cloud:row`.
    pub fn name(&self, scene: &Scene, object: u32) -> String {
        let Some(rest) = object.checked_sub(self.singles) else {
            return scene.primitive_name(object as usize).unwrap_or_default();
        };
        let cloud = if self.instances { self.cloud(object) } else { rest };
        let given = scene.clouds.get(cloud as usize).and_then(|cloud| cloud.name.clone());
        let name = given.unwrap_or_else(|| format!("cloud {cloud}"));
        if self.instances { format!("{name}:{}", object - self.starts[cloud as usize]) } else { name }
    }

    /// The group of a primitive, counted from 1; 0 for none.
    pub fn group(&self, scene: &Scene, primitive: u32) -> u32 {
        let group = match scene.objects.get(primitive as usize) {
            Some(object) => object.group,
            None => scene.clouds.get(self.cloud(primitive) as usize).and_then(|cloud| cloud.group),
        };
        group.map_or(0, |group| group as u32 + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLOUDS: &str = r#"
        format = 1
        [materials.clay]
        type = "diffuse"
        [[groups]]
        name = "left"
        [[shapes]]
        type = "sphere"
        center = [0, 0, 0]
        radius = 1
        material = "clay"
        [[shapes]]
        type = "sphere"
        name = "ball"
        group = "left"
        center = [0, 0, 0]
        radius = 1
        material = "clay"
        [[clouds]]
        type = "spheres"
        file = "a.csv"
        material = "clay"
        [[clouds]]
        type = "spheres"
        name = "dust"
        group = "left"
        file = "a.csv"
        material = "clay"
    "#;

    #[test]
    fn clouds_are_objects_or_their_rows_are() {
        let room = tempfile::tempdir().unwrap();
        std::fs::write(room.path().join("a.csv"), "x,y,z,r\n0,0,0,1\n1,1,1,2\n2,2,2,1\n").unwrap();
        let scene = Scene::from_toml(CLOUDS, room.path()).unwrap();
        let names = |objects: &Objects| -> Vec<String> {
            (0..8).map(|primitive| objects.name(&scene, objects.of(primitive))).collect()
        };
        let (grouped, each) = (Objects::new(&scene, false), Objects::new(&scene, true));
        assert_eq!((grouped.count(), each.count()), (4, 8));
        let clouds = ["cloud 0"; 3].into_iter().chain(["dust"; 3]);
        assert_eq!(names(&grouped), ["sphere 0", "ball"].into_iter().chain(clouds).collect::<Vec<_>>());
        let rows = ["cloud 0:0", "cloud 0:1", "cloud 0:2", "dust:0", "dust:1", "dust:2"];
        assert_eq!(grouped.of_all([0, 1, 2, 3, 4, 5, 6, 7]), [0, 1, 2, 2, 2, 3, 3, 3]);
        assert_eq!(names(&each), ["sphere 0", "ball"].into_iter().chain(rows).collect::<Vec<_>>());
        let groups: Vec<u32> = (0..8).map(|primitive| each.group(&scene, primitive)).collect();
        assert_eq!(groups, [0, 1, 0, 0, 0, 1, 1, 1]);
    }
}
