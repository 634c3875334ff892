//! The real binary, in a directory of its own.
#![allow(dead_code)] // each test file uses a part of it

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use tempfile::TempDir;

/// A sphere over a floor, with a light: enough for every command, small enough for every test.
pub const SCENE: &str = r#"format = 1
[image]
width = 48
height = 32
spp = 4
[camera]
type = "pinhole"
eye = [0, 1, 6]
target = [0, 0.5, 0]
vfov = 40
[materials.floor]
type = "diffuse"
[materials.mirror]
type = "mirror"
[[lights]]
type = "point"
position = [3, 5, 4]
intensity = [90, 90, 90]
[[shapes]]
type = "plane"
point = [0, 0, 0]
normal = [0, 1, 0]
material = "floor"
[[shapes]]
type = "sphere"
center = [0, 1, 0]
radius = 1
material = "mirror"
"#;

/// A scene of clay spheres of radius 1 under a point light: what `[image]` says, the cameras, place and intensity of the
/// light, and the centers of the spheres, as they stand in a scene file.
pub fn clay(image: &str, cameras: &str, (place, intensity): (&str, f64), centers: &[&str]) -> String {
    let sphere =
        |center: &&str| format!("[[shapes]]\ntype = \"sphere\"\ncenter = {center}\nradius = 1\nmaterial = \"clay\"\n");
    let spheres: String = centers.iter().map(sphere).collect();
    format!(
        "format = 1\nimage = {{ {image} }}\n{cameras}[materials.clay]\ntype = \"diffuse\"\nalbedo = [0.5, 0.5, 0.5]\n\
        [[lights]]\ntype = \"point\"\nposition = {place}\nintensity = [{intensity}, {intensity}, {intensity}]\n{spheres}"
    )
}

/// A directory for one test, with `scene.toml` in it.
pub struct Room(TempDir);

impl Room {
    pub fn new() -> Self {
        let room = Room(tempfile::tempdir().unwrap());
        std::fs::write(room.path("scene.toml"), SCENE).unwrap();
        room
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    /// All names in it but those of inputs, hidden ones too.
    pub fn outputs(&self) -> Vec<String> {
        let names = std::fs::read_dir(self.0.path()).unwrap().map(|entry| entry.unwrap().file_name());
        let mut names: Vec<_> = names.map(|name| name.into_string().unwrap()).collect();
        names.retain(|name| name != "scene.toml");
        names.sort();
        names
    }

    /// Runs `octray` here; arguments are separated by spaces.
    pub fn run(&self, arguments: &str) -> Assert {
        self.command(arguments).assert()
    }

    /// The command, to be changed first.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(binary());
        command.current_dir(self.0.path()).args(arguments.split_whitespace());
        for name in ["NO_COLOR", "SLURM_CPUS_PER_TASK", "SOURCE_DATE_EPOCH"] {
            command.env_remove(name);
        }
        command
    }

    /// Runs it and takes both outputs, if it ends with this code.
    pub fn texts(&self, arguments: &str, code: i32) -> (String, String) {
        let output = self.command(arguments).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        let (out, err) = (text(output.stdout), text(output.stderr));
        assert_eq!(output.status.code(), Some(code), "octray {arguments}\n{out}{err}");
        assert!(!err.contains("panicked") && !err.contains("a mistake in octray"), "octray {arguments}\n{err}");
        (out, err)
    }
}

pub fn binary() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_octray"))
}

/// A scene of the repository.
pub fn scene(name: &str) -> String {
    format!("{}/scenes/{name}", env!("CARGO_MANIFEST_DIR"))
}
