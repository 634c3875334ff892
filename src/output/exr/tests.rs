use std::time::{Duration, SystemTime};

use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, IntegerBounds, SampleType};
use exr::meta::header::Header;
use exr::prelude::LineOrder;
use glam::DVec3;
use half::f16;

use super::*;
use crate::film::{Channel, Cryptomatte, Plane, Samples, Window};
use crate::output::{self, Options, Run, description};
use crate::scene::{Camera, Lens};

const FLOAT: Storage = Storage {
    float: true,
    compression: Compression::Zips,
    multipart: false,
    root_depth: false,
    color: ColorSpace::Rec709,
    given: ColorSpace::Rec709,
    sidecar: false,
};

/// A crop whose samples no half holds exactly.
fn picture() -> Picture {
    let mut picture = Picture::new((40, 30), Window { x0: 7, y0: 5, x1: 24, y1: 18 });
    for (i, pixel) in picture.pixels.iter_mut().enumerate() {
        let i = i as f32;
        *pixel = [i * 0.1, 1.0 / (i + 3.0), (i * 0.7).sin().abs() * 1e3, 1.0 / (1.0 + i % 2.0)];
    }
    picture
}

fn described() -> Description {
    let date = SystemTime::UNIX_EPOCH + Duration::from_secs(1_709_210_096);
    Description {
        scene: Some("сцена.toml".into()),
        scene_hash: Some("00ff".into()),
        camera: Some(Camera {
            name: None,
            eye: DVec3::new(0.0, 0.0, 8.0),
            target: DVec3::ZERO,
            up: DVec3::Y,
            lens: Lens::Pinhole { vfov: 45.0 },
        }),
        spp: Some(16),
        seed: Some(u64::MAX),
        frame: Some(12),
        frames_per_second: Some((25, 1)),
        owner: Some("someone".into()),
        comments: Some(String::new()),
        run: Some(Run { date, seconds: 1.5, threads: 2, rays: Some("9".into()), shard: Some("1/4".into()) }),
        ..Description::default()
    }
}

fn header(bytes: &[u8]) -> Header {
    MetaData::read_from_buffered(bytes, true).unwrap().headers[0].clone()
}

fn written_and_read(picture: &Picture, float: bool) -> (Picture, Losses) {
    let room = tempfile::tempdir().unwrap();
    let path = room.path().join("a.exr");
    let options = Options { exr: Storage { float, ..Storage::default() }, ..Options::default() };
    let losses = output::write(&path, picture, options, &described()).unwrap();
    (output::read(&path).unwrap(), losses)
}

#[test]
fn floats_come_back_as_they_were() {
    let picture = picture();
    assert_eq!(written_and_read(&picture, true), (picture, Losses::default()));
}

#[test]
fn halves_come_back_as_the_nearest_ones() {
    let picture = picture();
    let (back, losses) = written_and_read(&picture, false);
    assert_eq!((back.display, back.window, losses), (picture.display, picture.window, Losses::default()));
    let mut rounded = 0;
    for (got, want) in back.pixels.iter().flatten().zip(picture.pixels.iter().flatten()) {
        assert_eq!(*got, f16::from_f32(*want).to_f32());
        // Half a unit in the last of eleven bits.
        assert!((got - want).abs() <= want * 2f32.powi(-11), "{got} {want}");
        rounded += usize::from(got != want);
    }
    assert!(rounded > 400, "{rounded}");
}

#[test]
fn what_a_sample_cannot_be_is_clamped_or_dropped_and_counted() {
    let mut picture = Picture::new((2, 1), Window::full((2, 1)));
    picture.pixels = vec![[f32::NAN, f32::INFINITY, 65519.0, 1.0], [1e9, -1e9, f32::NEG_INFINITY, 65504.0]].into();
    let (half, losses) = written_and_read(&picture, false);
    assert_eq!(half.pixels, [[0.0, 0.0, 65504.0, 1.0], [65504.0, -65504.0, 0.0, 65504.0]]);
    assert_eq!(losses, Losses { clamped: 3, dropped: 3 });
    let (float, losses) = written_and_read(&picture, true);
    assert_eq!(float.pixels, [[0.0, 0.0, 65519.0, 1.0], [1e9, -1e9, 0.0, 65504.0]]);
    assert_eq!(losses, Losses { clamped: 0, dropped: 3 });
}

#[test]
fn the_header_says_windows_channels_and_compression() {
    let header = header(&encode(&picture(), Storage::default(), &described()).unwrap().bytes);
    assert_eq!(header.data_window(), IntegerBounds::new((7, 5), (17, 13)));
    assert_eq!(header.shared_attributes.display_window, IntegerBounds::new((0, 0), (40, 30)));
    assert_eq!((header.compression, header.line_order), (Compression::Zips.method(), LineOrder::Increasing));
    let channels = header.channels.list.iter().map(|channel| channel.name.to_string());
    assert_eq!(channels.collect::<String>(), "ABGR");
    assert_eq!(header.channels.uniform_sample_type, Some(SampleType::F16));
    let white = header.shared_attributes.chromaticities.unwrap().white;
    assert_eq!(white, Vec2(0.3127, 0.3290));
}

#[test]
fn the_header_says_where_the_picture_comes_from() {
    let header = header(&encode(&picture(), FLOAT, &described()).unwrap().bytes);
    let own = &header.own_attributes;
    assert_eq!(own.software_name, Some(text(&description::software())));
    assert_eq!(own.capture_date, Some(text("2024:02:29 12:34:56")));
    assert_eq!((own.utc_offset, own.frames_per_second), (Some(0.0), Some((25, 1))));
    assert_eq!((own.owner.clone(), own.screen_window_center), (Some(text("someone")), Vec2(0.0, 0.0)));
    let value = |name: &str| own.other.get(&text(name)).cloned();
    assert_eq!(value("render/scene"), Some(AttributeValue::Text(text("сцена.toml"))));
    assert_eq!(value("render/seed"), Some(AttributeValue::Text(text("18446744073709551615"))));
    assert_eq!(value("samplesPerPixel"), Some(AttributeValue::I32(16)));
    assert_eq!(value("renderTimeSeconds"), Some(AttributeValue::F32(1.5)));
    assert_eq!(value("render/threads"), Some(AttributeValue::I32(2)));
    assert_eq!(own.other.len(), 12);
}

#[test]
fn without_a_run_nothing_differs_between_runs() {
    let description = Description { run: None, ..described() };
    let first = encode(&picture(), Storage::default(), &description).unwrap();
    // Every hash map has seeds of its own, so unsorted attributes would differ at once.
    for _ in 0..8 {
        assert!(encode(&picture(), Storage::default(), &description).unwrap() == first);
    }
    let own = header(&first.bytes).own_attributes;
    assert_eq!((own.capture_date, own.utc_offset, own.other.len()), (None, None, 7));
}

#[test]
fn a_picture_that_is_not_whole_is_refused() {
    let empty = Picture::new((4, 4), Window { x0: 2, y0: 2, x1: 2, y1: 4 });
    let mut short = picture();
    short.pixels = short.pixels[1..].to_vec().into();
    let one = Window::full((1, 1));
    let far = Window { x0: i32::MAX - 1, y0: 0, x1: i32::MAX, y1: 1 };
    for picture in
        [empty, short, Picture::new((4, 4), far), Picture::new((0, 0), one), Picture::new((u32::MAX, 1), one)]
    {
        assert!(encode(&picture, Storage::default(), &described()).is_err(), "{:?}", picture.window);
    }
}

/// The picture with a channel of each kind, and a Cryptomatte.
fn layered() -> Picture {
    let mut picture = picture();
    let area = picture.window.area();
    let floats = |factor: f32| (0..area).map(|i| factor * (i as f32 + 0.3)).collect::<Plane<_>>();
    let ids = |name: &str| Plane::from(vec![f32::from_bits(Cryptomatte::id(name)); area]);
    for (name, samples) in [
        ("depth.Z", Samples::Float(floats(0.37))),
        ("N.X", Samples::halves(&floats(0.001))),
        ("N.Y", Samples::halves(&floats(0.002))),
        ("N.Z", Samples::halves(&floats(-0.003))),
        ("id.object", Samples::Uint((0..area as u32).map(|i| i * 77_777_777).collect())),
        ("variance.R", Samples::Float(floats(1e-9))),
        ("crypto_object00.R", Samples::Float(ids("равнина"))),
        ("crypto_object00.G", Samples::Float(vec![0.75; area].into())),
        ("crypto_object00.B", Samples::Float(ids("torus"))),
        ("crypto_object00.A", Samples::Float(vec![0.25; area].into())),
    ] {
        picture.channels.push(Channel { name: name.into(), samples });
    }
    let manifest = ["равнина", "torus"].map(|name| (name.to_owned(), Cryptomatte::id(name))).into();
    picture.cryptomattes.push(Cryptomatte { name: "crypto_object".into(), manifest });
    picture
}

fn read_back(picture: &Picture, storage: Storage) -> output::Contents {
    let room = tempfile::tempdir().unwrap();
    let path = room.path().join("a.exr");
    output::write(&path, picture, Options { exr: storage, ..Options::default() }, &described()).unwrap();
    output::read_all(&path).unwrap()
}

/// Channels by name.
fn by_name(picture: &Picture) -> std::collections::BTreeMap<String, Samples> {
    picture.channels.iter().map(|channel| (channel.name.clone(), channel.samples.clone())).collect()
}

#[test]
fn layers_come_back_in_their_types_in_every_compression_and_as_parts() {
    let picture = layered();
    let mut hashes = std::collections::BTreeSet::new();
    for compression in Compression::ALL {
        for multipart in [false, true] {
            let contents = read_back(&picture, Storage { compression, multipart, ..FLOAT });
            assert_eq!((contents.picture.window, contents.float), (picture.window, true));
            let (got, want) = (by_name(&contents.picture), by_name(&picture));
            assert!(got.keys().eq(want.keys()), "{:?}", got.keys());
            for (name, samples) in &want {
                let lossy = compression.may_loose_data() && compression != Compression::Pxr24;
                if !(lossy && matches!(samples, Samples::Half(_))) {
                    assert_eq!(&got[name], samples, "{name} {compression:?} {multipart}");
                }
            }
            assert_eq!(contents.picture.cryptomattes, picture.cryptomattes);
            let hash = contents.pixel_hash.unwrap();
            assert_eq!(hash.stored, hash.found, "{compression:?} {multipart}");
            if !compression.may_loose_data() {
                assert_eq!(contents.picture.pixels, picture.pixels);
                hashes.insert(hash.found);
            }
        }
    }
    assert_eq!(hashes.len(), 1, "{hashes:?}");
}

#[test]
fn what_must_not_change_has_a_part_of_its_own_where_something_is_lost() {
    let bytes =
        encode(&layered(), Storage { compression: Compression::Dwaa, ..Storage::default() }, &described()).unwrap();
    let meta = MetaData::read_from_buffered(bytes.bytes.as_slice(), true).unwrap();
    let names = |header: &Header| header.channels.list.iter().map(|c| c.name.to_string()).collect::<Vec<_>>().join(" ");
    let [first, second] = &meta.headers[..] else { panic!("{}", meta.headers.len()) };
    assert_eq!(names(first), "A B G N.X N.Y N.Z R");
    assert_eq!(second.compression, Compression::Zips.method());
    assert!(names(second).starts_with("crypto_object00.A") && names(second).ends_with("variance.R"));
    let key = text("cryptomatte/f834d0a/name");
    assert!(!first.own_attributes.other.contains_key(&key) && second.own_attributes.other.contains_key(&key));
    // Without such layers one part is enough.
    let bytes = encode(&picture(), Storage { compression: Compression::Dwaa, ..FLOAT }, &described()).unwrap().bytes;
    assert_eq!(MetaData::read_from_buffered(bytes.as_slice(), true).unwrap().headers.len(), 1);
}

#[test]
fn a_part_a_layer_and_depth_at_the_root() {
    let storage = Storage { multipart: true, root_depth: true, ..Storage::default() };
    let bytes = encode(&layered(), storage, &described()).unwrap().bytes;
    let meta = MetaData::read_from_buffered(bytes.as_slice(), true).unwrap();
    let names: Vec<_> = meta.headers.iter().map(|h| h.own_attributes.layer_name.clone().unwrap().to_string()).collect();
    assert_eq!(names, ["rgba", "N", "crypto_object", "depth", "id", "variance"]);
    assert_eq!(meta.headers[3].channels.list[0].name, text("Z"));
}

#[test]
fn a_header_holds_the_manifest_or_names_its_file() {
    let value = |contents: &[u8], field: &str| {
        let own = &header(contents).own_attributes.other;
        match own.get(&text(&format!("cryptomatte/f834d0a/{field}"))) {
            Some(AttributeValue::Text(text)) => Some(String::from_utf8(text.as_slice().to_vec()).unwrap()),
            _ => None,
        }
    };
    let inside = encode(&layered(), Storage::default(), &described()).unwrap();
    assert_eq!(value(&inside.bytes, "manifest").as_deref(), Some(r#"{"torus":"f19c73fd","равнина":"9623511e"}"#));
    assert_eq!(value(&inside.bytes, "hash").as_deref(), Some("MurmurHash3_32"));
    assert_eq!(value(&inside.bytes, "conversion").as_deref(), Some("uint32_to_float32"));
    let room = tempfile::tempdir().unwrap();
    let options = Options { exr: Storage { sidecar: true, ..Storage::default() }, ..Options::default() };
    output::write(&room.path().join("shot.0001.exr"), &layered(), options, &described()).unwrap();
    let bytes = std::fs::read(room.path().join("shot.0001.exr")).unwrap();
    assert_eq!(value(&bytes, "manif_file").as_deref(), Some("shot.0001.crypto_object.json"));
    assert_eq!(value(&bytes, "manifest"), None);
    let json = std::fs::read_to_string(room.path().join("shot.0001.crypto_object.json")).unwrap();
    assert_eq!(json, r#"{"torus":"f19c73fd","равнина":"9623511e"}"#);
    let back = output::read(&room.path().join("shot.0001.exr")).unwrap();
    assert_eq!(back.cryptomattes, layered().cryptomattes);
}

#[test]
fn equal_pictures_are_equal_bytes_in_parts_and_from_a_file_again() {
    let description = Description { run: None, ..described() };
    let storage = Storage { multipart: true, ..FLOAT };
    let first = encode(&layered(), storage, &description).unwrap();
    for _ in 0..6 {
        assert!(encode(&layered(), storage, &description).unwrap() == first);
    }
    let room = tempfile::tempdir().unwrap();
    std::fs::write(room.path().join("a.exr"), &first.bytes).unwrap();
    let back = output::read_all(&room.path().join("a.exr")).unwrap();
    let again = encode(&back.picture, storage, &Description { kept: back.attributes, ..Description::default() });
    assert!(again.unwrap().bytes == first.bytes);
}

/// A tall picture of all kinds of channels, and some rows of it.
fn tall() -> Picture {
    let (window, area) = (Window { x0: -2, y0: 11, x1: 7, y1: 11 + 300 }, 9 * 300);
    let mut picture = Picture::new((5, 320), window);
    picture.pixels.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = [i as f32 * 40.0, f32::NAN, 0.3, 1.0]);
    let floats: Plane<f32> = (0..area).map(|i| 0.37 * i as f32).collect();
    for (name, samples) in [
        ("albedo.R", Samples::halves(&floats)),
        ("albedo.G", Samples::halves(&floats)),
        ("albedo.B", Samples::halves(&floats)),
        ("crypto_object00.R", Samples::Float(floats.clone())),
        ("depth.Z", Samples::Float(floats)),
        ("id.object", Samples::Uint((0..area as u32).collect())),
    ] {
        picture.channels.push(Channel { name: name.into(), samples });
    }
    picture.cryptomattes = layered().cryptomattes;
    picture
}

/// Rows that come one band after another, the last ones first, make the file of the whole picture; and so does what is told
/// of the rows so far with those that wait.
#[test]
fn rows_in_bands_make_the_same_file() {
    let picture = tall();
    for compression in Compression::ALL {
        for (multipart, color) in [(false, ColorSpace::AcesCg), (true, ColorSpace::Rec709)] {
            let storage = Storage { compression, multipart, color, ..Storage::default() };
            let whole = encode(&picture, storage, &described()).unwrap();
            // Through a matrix one NaN becomes three.
            let dropped = if multipart { 2700 } else { 3 * 2700 };
            assert!(whole.losses.dropped == dropped && multipart == (whole.losses.clamped > 0), "{:?}", whole.losses);
            let packer = Packer::new(&picture, storage).unwrap();
            let high = 32.max(packer.rows()) as i32;
            let bands = (0..300 / high + 1).rev().map(|band| {
                let y0 = 11 + band * high;
                picture.crop(Window { y0, y1: (y0 + high).min(311), ..picture.window }).unwrap()
            });
            let (late, early): (Vec<_>, Vec<_>) = bands.partition(|rows| rows.window.y0 < 11 + high);
            early.iter().for_each(|rows| packer.pack(rows));
            let so_far = packer.so_far(late.iter().cloned()).unwrap();
            assert!(so_far.finish(&picture.cryptomattes, &described()).unwrap() == whole, "{compression:?}");
            late.iter().for_each(|rows| packer.pack(rows));
            assert!(packer.finish(&picture.cryptomattes, &described()).unwrap() == whole, "{compression:?}");
        }
    }
}

#[test]
fn a_file_that_lacks_rows_is_refused() {
    let picture = tall();
    let packer = Packer::new(&picture, FLOAT).unwrap();
    packer.pack(&picture.crop(Window { y1: 200, ..picture.window }).unwrap());
    assert!(packer.seconds() > 0.0 && packer.finish(&picture.cryptomattes, &described()).is_err());
}

#[test]
fn a_changed_sample_changes_the_hash() {
    let hash = |picture: &Picture| read_back(picture, FLOAT).pixel_hash.unwrap().found;
    let (picture, mut other) = (layered(), layered());
    other.pixels[17][2] = other.pixels[17][2].next_up();
    assert_ne!(hash(&picture), hash(&other));
    let mut other = layered();
    other.channels[0].name = "depths.Z".into();
    assert_ne!(hash(&picture), hash(&other));
    let mut other = layered();
    other.window = Window { x0: 8, x1: 25, ..other.window };
    assert_ne!(hash(&picture), hash(&other));
}

#[test]
fn acescg_is_said_and_read_back() {
    let contents = read_back(&layered(), Storage { color: ColorSpace::AcesCg, ..FLOAT });
    for (got, want) in contents.picture.pixels.iter().flatten().zip(layered().pixels.iter().flatten()) {
        assert!((got - want).abs() <= 1e-6 * want.abs().max(1e3), "{got} {want}");
    }
    let said = contents.attributes.unwrap().shared.chromaticities.unwrap();
    assert_eq!((said.red, said.white), (Vec2(0.713, 0.293), Vec2(0.32168, 0.33767)));
    assert_eq!(by_name(&contents.picture)["N.X"], by_name(&layered())["N.X"]);
}

#[test]
fn names_that_clash_are_refused() {
    let mut picture = layered();
    picture.channels[1].name = "depth.Z".into();
    assert_eq!(encode(&picture, FLOAT, &described()).unwrap_err().0, "two channels are called \"depth.Z\"");
    picture.channels[1].name = String::new();
    assert!(encode(&picture, FLOAT, &described()).is_err());
}

/// A damaged header may give a standard name to an attribute of another type: it is left out of the next file.
#[test]
fn attributes_that_no_file_can_have_are_not_kept() {
    let mut kept = read_back(&layered(), FLOAT).attributes.unwrap();
    for name in ["lineOrder", "software", ""] {
        kept.own.other.insert(text(name), AttributeValue::I32(1));
        kept.shared.other.insert(text(name), AttributeValue::I32(1));
    }
    kept.own.other.insert(text("mine"), AttributeValue::I32(1));
    let description = Description { kept: Some(kept), ..Description::default() };
    let bytes = encode(&layered(), FLOAT, &description).unwrap().bytes;
    let own = header(&bytes).own_attributes.other;
    assert_eq!(own.get(&text("mine")), Some(&AttributeValue::I32(1)));
    assert!(!own.contains_key(&text("lineOrder")));
}
