//! Files of atoms: real ones say what they hold, broken ones are refused with their line, and whatever is done to
//! them, the readers do not panic.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;
use octray::Scene;
use octray::scene::particles::{Bonds, Coloring, Format, Look, Radius, Style, Trajectory};
use octray::scene::{CloudShapes, Frames, Rows, SceneErrors};
use proptest::prelude::*;

fn path(name: &str) -> PathBuf {
    Path::new("scenes/particles").join(name)
}

/// A file with this text, in a directory that lives as long as the first part.
fn file(name: &str, text: impl AsRef<[u8]>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    (folder, path)
}

fn with_look(path: &Path, look: Look, frame: i64) -> Result<Scene, SceneErrors> {
    Frames::new(path).look(look).scene(frame)
}

fn spheres(scene: &Scene) -> &Vec<[f64; 4]> {
    match &scene.clouds[0].shapes {
        CloudShapes::Spheres(Rows::F64(rows)) => rows,
        other => panic!("{other:?}"),
    }
}

fn sticks(scene: &Scene) -> &[[f64; 7]] {
    match scene.clouds.get(1).map(|cloud| &cloud.shapes) {
        Some(CloudShapes::Cylinders(Rows::F64(rows), false)) => rows,
        None => &[],
        other => panic!("{other:?}"),
    }
}

fn atoms(path: &Path, frame: i64) -> Vec<[f64; 4]> {
    let scene = Scene::load_frame(path, frame).unwrap_or_else(|errors| panic!("{errors}"));
    spheres(&scene).clone()
}

/// Frames, atoms of the last frame, and its last atom, as the files' own lines say.
#[test]
fn real_files_hold_what_their_lines_say() {
    // The box of nacl is 22.560801 wide from -1.41005; its last atom is at 0.9375 of it in frame 1.
    let cases: &[(&str, u64, usize, [f64; 3])] = &[
        ("methane.xyz", 1, 5, [-0.631716, 0.631716, -0.631716]),
        ("spaces.xyz", 1, 64, [0.0536, 0.8981, 0.6369]),
        ("trajectory.xyz", 2, 9, [0.498769, 3.897557, 5.812576]),
        ("hemo.pdb", 1, 522, [f64::NAN; 3]),
        ("MOF-5.pdb", 1, 65, [f64::NAN; 3]),
        ("4hhb.pdb", 1, 4779, [f64::NAN; 3]),
        ("odd-start.pdb", 1, 20, [f64::NAN; 3]),
        ("short-atom.pdb", 1, 9, [0.560, 6.554, 0.717]),
        ("insertion-code.pdb", 1, 4, [1.0, 2.0, 3.0]),
        ("aspirin.sdf", 1, 21, [f64::NAN; 3]),
        ("extended.xyz", 3, 8, [f64::NAN; 3]),
        ("helium.xyz.gz", 397, 125, [f64::NAN; 3]),
        ("water.xyz.gz", 100, 297, [f64::NAN; 3]),
        ("nacl.lammpstrj", 6, 512, [f64::NAN; 3]),
        ("polymer.lammpstrj.gz", 42, 1714, [f64::NAN; 3]),
        ("solvated.lmp.gz", 1, 7772, [f64::NAN; 3]),
    ];
    for (name, frames, count, last) in cases {
        let path = path(name);
        assert_eq!(Frames::new(&path).count().unwrap(), Some(*frames), "{name}");
        let rows = atoms(&path, *frames as i64);
        assert_eq!(rows.len(), *count, "{name}");
        if last[0].is_finite() {
            assert_eq!(rows[count - 1][..3], last[..], "{name}");
        }
    }
    let first = atoms(&path("nacl.lammpstrj"), 1)[0];
    assert!(first[..3].iter().all(|x| (x - (-1.41005 + 0.0625 * 22.560801)).abs() < 1e-12), "{first:?}");
}

/// Every broken file of the collection, with the line, and what is said of it.
#[test]
fn broken_files_are_refused_or_warned_about() {
    let cases = [
        ("atom-duplicated-id.lammpstrj", "11:1: warning: id 2 is given twice"),
        (
            "atom-item-name.lammpstrj",
            "9:1: this must be \"ITEM: ATOMS\" with the names of the columns, found \"ITEM: DUMMY\"",
        ),
        ("atom-no-item.lammpstrj", "9:1: this must be \"ITEM: ATOMS\" with the names of the columns, found \"DUMMY\""),
        ("atom-not-enough-lines.lammpstrj", "12:1: there must be atom 3 of 3, found the end of the file"),
        ("atom-too-many-fields.lammpstrj", "10:11: an atom must have 5 columns, found \"X\""),
        ("bad-atom-line.sdf", "5:21: columns 21 to 30 must hold a coordinate, a number, found the end of the line"),
        ("box-item-name.lammpstrj", "5:1: this must be \"ITEM: BOX BOUNDS\", found \"ITEM: DUMMY\""),
        ("box-not-item.lammpstrj", "5:1: this must be \"ITEM: BOX BOUNDS\", found \"DUMMY\""),
        ("box-not-numbers.lammpstrj", "6:1: a bound of the box must be a number, found \"DUMMY\""),
        ("box-wrong-size.lammpstrj", "6:46: a bound or tilt of the box must be a number, found the end of the line"),
        (
            "count-line-not-numbers.sdf",
            "4:1: the fourth line of a molecule must start with the counts of atoms and bonds",
        ),
        (
            "count-line-too-short.sdf",
            "4:1: the fourth line of a molecule must start with the counts of atoms and bonds",
        ),
        ("extended-bad-properties.xyz", "3:1: a coordinate must be a number, found \"H\""),
        ("extended.xyz", "3:14: an atom must have 5 columns, found 4"),
        ("helium.xyz", "7:1: there must be atom 5 of 8, found the end of the file"),
        ("items-after-atoms.lammpstrj", "16:1: warning: the next frame is broken: there must be \"ITEM: TIMESTEP\""),
        ("timestep-item-name.lammpstrj", "1:1: a frame must start with \"ITEM: TIMESTEP\", found \"ITEM: DUMMY\""),
        ("timestep-no-item.lammpstrj", "1:1: a frame must start with \"ITEM: TIMESTEP\", found \"DUMMY\""),
    ];
    for (name, want) in cases {
        let path = path("bad").join(name);
        let said = match Scene::load(&path) {
            Ok(scene) => scene.warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"),
            Err(errors) => errors.to_string(),
        };
        assert!(said.starts_with(&format!("{}:{want}", path.display())), "{said}\nis not\n{want}");
    }
    assert_eq!(fs::read_dir(path("bad")).unwrap().count(), cases.len());
}

/// The frames of a broken collection one by one: each is refused, or warned about where the column is not used.
#[test]
fn each_broken_frame_of_extended_xyz_is_noticed() {
    for (name, warned) in [("extended.xyz", 4), ("extended-bad-properties.xyz", 0)] {
        let text = fs::read_to_string(path("bad").join(name)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let mut warnings = 0;
        for frame in lines.chunks(3) {
            let (_folder, path) = file("one.xyz", frame.join("\n") + "\n");
            match Scene::load(&path) {
                Ok(scene) => {
                    assert_eq!((scene.warnings.len(), scene.warnings[0].place.line), (1, 3), "{frame:?}");
                    warnings += 1;
                }
                Err(errors) => assert!(errors.iter().all(|error| error.place.line > 0), "{errors}"),
            }
        }
        assert_eq!(warnings, warned, "{name}");
    }
}

#[test]
fn bonds_come_from_the_file_or_from_distances() {
    let halves = |name: &str, bonds, style| {
        let look = Look { bonds, style: Some(style), ..Look::default() };
        sticks(&with_look(&path(name), look, 1).unwrap()).len()
    };
    assert_eq!(halves("aspirin.sdf", Bonds::Auto, Style::BallAndStick), 42, "21 bonds");
    assert_eq!(halves("aspirin.sdf", Bonds::None, Style::BallAndStick), 0);
    assert_eq!(halves("methane.xyz", Bonds::Auto, Style::Licorice), 8);
    assert_eq!(halves("methane.xyz", Bonds::Auto, Style::Spheres), 0);
    assert_eq!(halves("methane.xyz", Bonds::Within(1.2), Style::Spheres), 8, "asked for, so drawn");
    // The file names no cell, so the molecules that its boundary cuts have lost some of their 198 bonds.
    let water =
        Trajectory::open(&path("water.xyz.gz"), Format::Xyz, Default::default(), false).unwrap().frame(1).unwrap();
    let near =
        |a: &[f64; 4], b: &[f64; 4]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt() < 0.66 + 0.31 + 0.45;
    let (oxygens, hydrogens) =
        (water.atoms.iter().step_by(3), || water.atoms.iter().enumerate().filter(|(i, _)| i % 3 > 0));
    let bonds: usize = oxygens.map(|o| hydrogens().filter(|(_, h)| near(o, h)).count()).sum();
    assert_eq!(halves("water.xyz.gz", Bonds::Auto, Style::BallAndStick), 2 * bonds);
    assert!((180..198).contains(&bonds), "{bonds}");
    assert_eq!(halves("solvated.lmp.gz", Bonds::Auto, Style::BallAndStick), 2 * 6248);
    // CONECT records are about the haems alone; distances join the protein.
    let conect = halves("4hhb.pdb", Bonds::File, Style::BallAndStick);
    let all = halves("4hhb.pdb", Bonds::Auto, Style::BallAndStick);
    assert!(conect > 300 && all > 2 * 4384 && all < 2 * 5000, "{conect} {all}");
}

/// No half of a bond is longer than half a bond can be: bonds through the boundary of the cell are not drawn across it.
#[test]
fn no_bond_goes_across_the_cell() {
    let look = Look { style: Some(Style::BallAndStick), ..Look::default() };
    for name in ["solvated.lmp.gz", "MOF-5.pdb", "4hhb.pdb", "hemo.pdb", "extended.xyz"] {
        let scene = with_look(&path(name), look.clone(), 1).unwrap();
        assert!(!sticks(&scene).is_empty());
        for [a, b, c, x, y, z, _] in sticks(&scene) {
            let length = ((a - x).powi(2) + (b - y).powi(2) + (c - z).powi(2)).sqrt();
            assert!(length < 1.6, "{name} {length}");
        }
    }
}

#[test]
fn cells_are_repeated() {
    let look = Look { replicate: [3, 2, 1], ..Look::default() };
    let (one, six) = (atoms(&path("nacl.lammpstrj"), 1), with_look(&path("nacl.lammpstrj"), look.clone(), 1).unwrap());
    let rows = spheres(&six);
    assert_eq!((rows.len(), six.clouds[0].colors.as_ref().unwrap().len()), (6 * 512, 6 * 512));
    let size = 22.560801;
    for (copy, shift) in [[0., 0.], [1., 0.], [2., 0.], [0., 1.], [1., 1.], [2., 1.]].into_iter().enumerate() {
        let (row, first) = (rows[512 * copy + 17], one[17]);
        assert!(
            (row[0] - first[0] - shift[0] * size).abs() < 1e-9 && (row[1] - first[1] - shift[1] * size).abs() < 1e-9
        );
        assert_eq!((row[2], row[3]), (first[2], first[3]));
    }
    let errors = with_look(&path("methane.xyz"), look, 1).unwrap_err().to_string();
    assert!(errors.contains("replicate must be left out: the file names no cell"), "{errors}");
    let most = Look { replicate: [65536; 3], ..Look::default() };
    assert!(with_look(&path("nacl.lammpstrj"), most, 1).unwrap_err().to_string().contains("at most 2^31 - 1"));
}

#[test]
fn radii_and_colours_are_what_the_look_says() {
    let radius = |name: &str, look: Look| spheres(&with_look(&path(name), look, 1).unwrap())[0][3];
    let look = |radius| Look { radius, ..Look::default() };
    assert_eq!(radius("methane.xyz", Look::default()), 1.70, "van der Waals");
    assert_eq!(radius("methane.xyz", look(Radius::Covalent)), 0.76);
    assert_eq!(radius("methane.xyz", look(Radius::Same(0.3))), 0.3);
    assert_eq!(radius("aspirin.sdf", Look::default()), 0.25 * 1.52, "a ball of oxygen");
    // No elements: half the distance to the nearest neighbour.
    let touching = radius("nacl.lammpstrj", Look::default());
    assert!((touching - 0.5 * 22.560801 / 8.0).abs() < 1e-4, "{touching}");
    let column = Coloring::Column { name: "vx".into(), map: Default::default(), range: Some([-0.01, 0.01]) };
    let scene = with_look(&path("nacl.lammpstrj"), Look { color: column, ..Look::default() }, 1).unwrap();
    let colors = scene.clouds[0].colors.as_ref().unwrap();
    assert!(colors.iter().any(|color| *color != colors[0]), "velocities differ");
    let none = Coloring::Column { name: "q".into(), map: Default::default(), range: None };
    let errors =
        with_look(&path("nacl.lammpstrj"), Look { color: none, ..Look::default() }, 1).unwrap_err().to_string();
    assert!(errors.contains(":9:1: the atoms have no column \"q\"; their columns: xs, ys, zs, vx, vy, vz"), "{errors}");
}

#[test]
fn radius_and_colour_columns_of_the_file_are_used() {
    let text = "2\nProperties=pos:R:3:radius:R:1:color:R:3:Z:I:1 Lattice=\"9 0 0 0 9 0 0 0 9\"\n\
                1 2 3 0.5 1 0 0 6\n4 5 6 0.25 0 0 1 8\n";
    let (_folder, path) = file("a.extxyz", text);
    let scene = Scene::load(&path).unwrap();
    assert_eq!(*spheres(&scene), [[1., 2., 3., 0.5], [4., 5., 6., 0.25]]);
    assert_eq!(scene.clouds[0].colors.as_deref(), Some(&[[1., 0., 0.], [0., 0., 1.]][..]));
    let (_folder, path) = file("a.dump", DUMP);
    let scene = Scene::load(&path).unwrap();
    assert_eq!(*spheres(&scene), [[2., 2., 3., 0.5], [7., 5., 6., 1.0]], "in the order of ids, diameters halved");
}

/// Two atoms in a tilted box, ids not in order.
const DUMP: &str = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS xy xz yz pp pp ff\n\
    0 14 4\n0 10 0\n0 10 0\nITEM: ATOMS id type x y z diameter\n9 1 7 5 6 2\n3 2 2 2 3 1\n";

#[test]
fn tilted_boxes_are_the_ones_inside_their_bounds() {
    let (_folder, path) = file(
        "a.lammpstrj",
        DUMP.replace("x y z diameter", "xs ys zs diameter")
            .replace("7 5 6 2", "0 1 0 2")
            .replace("2 2 3 1", "1 0.5 0.5 1"),
    );
    // Edges (10 0 0), (4 10 0), (0 0 10).
    assert_eq!(atoms(&path, 1), [[12., 5., 5., 0.5], [4., 10., 0., 1.0]]);
    let flat = DUMP.replace("0 10 0\n0 10 0", "0 10 0\n0 0 0").replace("x y z d", "xs ys zs d");
    let (_folder, path) = file("a.lammpstrj", flat);
    assert!(Scene::load(&path).unwrap_err().to_string().contains(":9:1: scaled positions need a box"));
}

#[test]
fn atom_styles_of_data_files_are_said_or_refused() {
    let data = |atoms: &str| {
        format!(
            "title\n\n2 atoms\n1 bonds\n2 atom types\n0 10 xlo xhi\n0 10 ylo yhi\n0 10 zlo zhi\n\nMasses\n\n1 12.011\n2 15.9994 # O\n\n{atoms}\n\nBonds\n\n1 1 7 9\n"
        )
    };
    let load = |atoms: &str| {
        let (_folder, path) = file("a.data", data(atoms));
        let look = Look { style: Some(Style::BallAndStick), ..Look::default() };
        with_look(&path, look, 1).map_err(|errors| Box::new(errors.iter().next().unwrap().clone()))
    };
    let scene = load("Atoms # charge\n\n9 2 -0.5 9.5 2 3\n7 1 0.5 0.5 2 3").unwrap();
    assert_eq!(*spheres(&scene), [[0.5, 2., 3., 0.25 * 1.70], [9.5, 2., 3., 0.25 * 1.52]]);
    assert_eq!(sticks(&scene)[0][..6], [0.5, 2., 3., 0., 2., 3.], "the bond goes through the boundary");
    let scene = load("Atoms\n\n9 1 2 -0.5 1 2 3 0 0 1\n7 1 1 0.5 4 5 6 0 0 0").unwrap();
    assert!(scene.warnings[0].text.contains("by its 10 columns it is taken for full"), "{:?}", scene.warnings);
    for (atoms, line, want) in [
        ("Atoms # dpd\n\n7 1 0.5 4 5 6", 17, "the style behind \"Atoms #\" must be one of"),
        ("Atoms\n\n7 1 2.5 1 2 3 4 5 6 7 8", 17, "the style of the atoms must be said"),
        ("Atoms # atomic\n\n7 1 1 2 3\n9 1 1 2", 18, "must have 5 columns"),
        ("Atoms # atomic\n\n7 1 1 2 3\n8 1 1 2 3", 22, "a bond must join two atoms of the file"),
        ("Atoms # atomic\n\n7 1 1 2 3", 19, "the title"),
    ] {
        let error = load(atoms).unwrap_err();
        assert!(error.message().contains(want) || want == "the title", "{error}");
        assert_eq!(error.place.line, line, "{error}");
    }
}

/// Atoms of version 3 have numbers of any order, and lines go on behind a hyphen.
#[test]
fn molecules_of_both_versions_are_read() {
    let v3000 = "ethene\n  x\n\n  0  0  0     0  0            999 V3000\nM  V30 BEGIN CTAB\nM  V30 COUNTS 2 1 0 0 0\n\
        M  V30 BEGIN ATOM\nM  V30 30 C 0 0 0 0\nM  V30 20 C 1.34 0 -\nM  V30 0 0 CHG=-1\nM  V30 END ATOM\nM  V30 BEGIN BOND\n\
        M  V30 1 2 30 20\nM  V30 END BOND\nM  V30 END CTAB\nM  END\n$$$$\n";
    let v2000 = fs::read_to_string(path("aspirin.sdf")).unwrap();
    let (_folder, path) = file("a.sdf", format!("{v3000}{v2000}"));
    let counts = [1, 2].map(|frame| {
        let scene = Scene::load_frame(&path, frame).unwrap();
        (spheres(&scene).len(), sticks(&scene).len())
    });
    assert_eq!(counts, [(2, 2), (21, 42)]);
    assert!(Scene::load_frame(&path, 3).unwrap_err().to_string().ends_with("has 2 frames: there is no frame 3"));
    let (_folder, path) = file("a.sdf", v2000.replacen("  1  5  1", "  1 55  1", 1));
    let errors = Scene::load(&path).map(|_| ()).unwrap_err().to_string();
    assert!(errors.contains("a bond must start with the numbers of two atoms, from 1 to 21"), "{errors}");
}

#[test]
fn models_are_frames_and_bonds_serve_all_of_them() {
    let model = |x: f64| {
        format!(
            "MODEL        1\nHETATM    1  C1  LIG A   1    {x:8.3}   0.000   0.000\nHETATM    2  O1  LIG A   1    {x:8.3}   9.000   0.000\nENDMDL\n"
        )
    };
    let text = format!(
        "CRYST1    1.000    1.000    1.000  90.00  90.00  90.00 P 1\n{}{}CONECT    1    2\nCONECT    1   77\nEND\n",
        model(1.0),
        model(2.0)
    );
    let (_folder, path) = file("a.pdb", text);
    let look = Look { style: Some(Style::Licorice), ..Look::default() };
    for frame in [1, 2] {
        let scene = with_look(&path, look.clone(), frame).unwrap();
        assert_eq!(spheres(&scene)[0][0], frame as f64);
        assert_eq!(sticks(&scene).len(), 2, "a unit cube is no cell: the bond is whole");
        assert!(
            scene.warnings[0]
                .to_string()
                .ends_with(":11:1: warning: bonds to atoms that the frame does not have are left out: 1"),
            "{:?}",
            scene.warnings
        );
    }
}

#[test]
fn packed_files_are_the_plain_ones() {
    for name in ["nacl.lammpstrj", "extended.xyz", "hemo.pdb", "aspirin.sdf"] {
        let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
        packer.write_all(&fs::read(path(name)).unwrap()).unwrap();
        let packed = packer.finish().unwrap();
        let (_folder, gz) = file(&format!("{name}.gz"), &packed);
        assert_eq!(atoms(&gz, 1), atoms(&path(name), 1));
        let (_folder, cut) = file(&format!("{name}.gz"), &packed[..packed.len() / 2]);
        let errors = Frames::new(&cut).count().unwrap_err();
        assert!(errors.iter().all(|error| error.place.line > 0), "{errors}");
    }
}

/// One after the other, from any start and backwards: the same atoms, and a camera that does not move.
#[test]
fn frames_are_the_same_in_any_order() {
    let path = path("polymer.lammpstrj.gz");
    let alone: Vec<_> = [3, 4, 9].map(|frame| Scene::load_frame(&path, frame).unwrap()).into();
    let mut frames = Frames::new(&path);
    for (frame, index) in [(3, 0), (4, 1), (9, 2), (4, 1), (3, 0)] {
        let scene = frames.scene(frame).unwrap();
        assert_eq!(spheres(&scene), spheres(&alone[index]), "{frame}");
        assert_eq!(scene.cameras, alone[0].cameras);
    }
    assert_ne!(spheres(&alone[0]), spheres(&alone[1]));
}

#[test]
fn scenes_hold_atoms_too() {
    let folder = std::path::absolute("scenes/particles").unwrap();
    let text = |more: &str| {
        format!(
            "format = 1\n[materials.a]\ntype = \"diffuse\"\n[[clouds]]\ntype = \"particles\"\nmaterial = \"a\"\n{more}"
        )
    };
    let read = |more: &str| Scene::from_toml(&text(more), &folder);
    let scene = read("file = \"trajectory.xyz\"\nframe = 2\nname = \"he\"\nradius = 0.5\ncolor = [1, 0, 0]\n").unwrap();
    assert_eq!(spheres(&scene)[0], [0.411134, 8.411223, 0.116507, 0.5]);
    assert_eq!(
        (scene.clouds[0].name.as_deref(), scene.clouds[0].colors.as_ref().unwrap()[8]),
        (Some("he"), [1., 0., 0.])
    );
    let scene = read("file = \"MOF-5.pdb\"\nstyle = \"ball-and-stick\"\nradius = \"covalent\"\nradius_scale = 0.5\nbond_radius = 0.2\nbonds = \"file\"\n").unwrap();
    assert_eq!((spheres(&scene)[0][3], sticks(&scene)[0][6]), (0.61, 0.2));
    let scene = read("file = \"nacl.lammpstrj\"\nradius = 1\nreplicate = [2, 1, 1]\ncolor = { column = \"vx\", map = \"coolwarm\", range = [-1, 1] }\n").unwrap();
    assert_eq!(scene.primitive_count(), 1024);
    let scene =
        read("file = \"polymer.lammpstrj.gz\"\nelements = [\"C\", \"O\", \"H\"]\nradius = { column = \"mol\" }\n")
            .unwrap();
    assert_eq!(spheres(&scene)[0][3], 1.0, "molecule 1");
    for (more, want) in [
        ("file = \"methane.xyz\"\nreplicate = [2, 2, 2]\n", "8:13: replicate must be left out: the file names no cell"),
        ("file = \"nacl.lammpstrj\"\nbonds = \"distance\"\n", "8:9: bonds by distance need the elements of atoms"),
        ("file = \"methane.toml\"\n", "7:8: methane.toml must be a file of atoms, ending in one of .xyz"),
        ("file = \"gone.xyz\"\n", "7:8: gone.xyz cannot be read: "),
        ("file = \"trajectory.xyz\"\nframe = 3\n", "7:8: trajectory.xyz has 2 frames: there is no frame 3"),
        ("file = \"methane.xyz\"\nradius = \"huge\"\n", "8:10: cloud radius must be a number, \"auto\""),
        (
            "file = \"methane.xyz\"\nradius = { column = \"7\" }\n",
            "methane.xyz:3:59: an atom must have 7 columns, found 4",
        ),
        (
            "file = \"methane.xyz\"\ncolor = { column = \"4\", range = [2, 1] }\n",
            "8:33: color range must be two numbers, the lower one first",
        ),
        ("file = \"methane.xyz\"\nelements = [\"Xx\"]\n", "8:13: cloud elements must hold symbols of elements"),
        ("file = \"bad/helium.xyz\"\n", "helium.xyz:7:1: there must be atom 5 of 8"),
    ] {
        let errors = read(more).map(|_| ()).unwrap_err().to_string();
        assert!(errors.contains(want), "{errors}\nis not\n{want}");
    }
}

/// Formats that a mutated file may be of, with a small real one each.
fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let cut = |name: &str, bytes: usize| fs::read(path(name)).unwrap()[..bytes].to_vec();
    vec![
        ("a.xyz", fs::read(path("trajectory.xyz")).unwrap()),
        ("a.extxyz", fs::read(path("extended.xyz")).unwrap()),
        ("a.lammpstrj", DUMP.repeat(2).into_bytes()),
        ("a.pdb", cut("hemo.pdb", 4000)),
        ("a.sdf", fs::read(path("aspirin.sdf")).unwrap()),
        ("a.data", b"t\n\n1 atoms\n1 bonds\n1 atom types\n0 1 xlo xhi\n0 1 ylo yhi\n0 1 zlo zhi\n\nMasses\n\n1 12\n\nAtoms # full\n\n1 1 1 0 1 2 3\n\nBonds\n\n1 1 1 1\n".to_vec()),
    ]
}

const PIECES: &[&str] = &[
    "",
    " ",
    "\n",
    "-1",
    "0",
    "9999999999999999999",
    "1e999",
    "nan",
    "ITEM:",
    "\u{0}",
    "é",
    "\"",
    "=",
    ":",
    "$$$$",
    "#",
    "END",
    "x",
];

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(600) })]

    #[test]
    fn any_change_of_a_file_is_read_or_refused(
        seed in 0..6usize,
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0..30usize, prop::sample::select(PIECES)), 1..5),
    ) {
        let (name, mut bytes) = seeds().swap_remove(seed);
        for (at, cut, piece) in edits {
            let at = at.index(bytes.len().max(1)).min(bytes.len());
            let end = (at + cut).min(bytes.len());
            bytes.splice(at..end, piece.bytes());
        }
        let (_folder, path) = file(name, &bytes);
        let look = Look { style: Some(Style::BallAndStick), ..Look::default() };
        let mut frames = Frames::new(&path).look(look);
        for frame in [1, 2] {
            if let Err(errors) = frames.scene(frame) {
                prop_assert!(!errors.to_string().is_empty() && !errors.report(false).is_empty());
            }
        }
    }
}

/// Memory follows a frame, not what a file promises.
#[test]
fn promises_of_many_atoms_are_not_believed() {
    for (name, text) in [
        ("a.xyz", "999999999999\n\nC 0 0 0\n".to_owned()),
        ("a.lammpstrj", DUMP.replace("ATOMS\n2\n", "ATOMS\n999999999999\n")),
        ("a.data", "t\n\n999999999999 atoms\n1 atom types\n\nAtoms # atomic\n\n1 1 0 0 0\n".to_owned()),
    ] {
        let (_folder, path) = file(name, text);
        let errors = Scene::load(&path).map(|_| ()).unwrap_err().to_string();
        assert!(errors.contains("of 999999999999, found the end of the file"), "{errors}");
    }
}

#[test]
fn a_trajectory_can_be_read_without_a_scene() {
    let mut water = Trajectory::open(&path("water.xyz.gz"), Format::Xyz, Default::default(), false).unwrap();
    let labels: Vec<_> = water.frame(100).unwrap().kinds.into_iter().map(|kind| kind.label).collect();
    assert_eq!(labels, ["O", "H"]);
    assert_eq!(water.count().unwrap(), 100);
}
