//! Looking on while a picture is rendered: a viewer that speaks tev's protocol, and SIGUSR1.

use std::io::Read;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

fn octray() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_octray"));
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

/// Takes numbers and names off a packet, all little endian, names ending with 0.
struct Packet<'a>(&'a [u8]);

impl Packet<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (first, rest) = self.0.split_first_chunk().expect("a longer packet");
        self.0 = rest;
        *first
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|byte| *byte == 0).expect("an end");
        let text = String::from_utf8(self.0[..end].to_vec()).expect("UTF-8");
        self.0 = &self.0[end + 1..];
        text
    }
}

/// What a viewer has in the end: size and samples, and how many updates it took.
type Shown = ((u32, u32), Vec<f32>, usize);

/// tev as its README describes the protocol: length (itself included), kind, then the kind's own.
fn view(listener: &TcpListener) -> Shown {
    let (mut stream, _) = listener.accept().expect("a caller");
    let (mut size, mut samples, mut updates) = ((0, 0), Vec::new(), 0);
    loop {
        let mut length = [0; 4];
        if stream.read_exact(&mut length).is_err() {
            return (size, samples, updates);
        }
        let mut body = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut body).expect("a whole packet");
        let mut packet = Packet(&body);
        match packet.bytes::<1>()[0] {
            4 => {
                packet.bytes::<1>();
                assert!(packet.text().ends_with("a.exr"));
                size = (packet.u32(), packet.u32());
                let channels: Vec<String> = (0..packet.u32()).map(|_| packet.text()).collect();
                assert_eq!(channels, ["R", "G", "B", "A"]);
                samples = vec![f32::NAN; (size.0 * size.1) as usize * 4];
            }
            6 => {
                packet.bytes::<1>();
                packet.text();
                let channels = packet.u32() as usize;
                (0..channels).for_each(|_| drop(packet.text()));
                let [x, y, width, height] = std::array::from_fn(|_| packet.u32());
                let offsets: Vec<u64> = (0..channels).map(|_| u64::from_le_bytes(packet.bytes())).collect();
                let strides: Vec<u64> = (0..channels).map(|_| u64::from_le_bytes(packet.bytes())).collect();
                let data: Vec<f32> =
                    packet.0.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
                for pixel in 0..width * height {
                    let place = (y + pixel / width) * size.0 + x + pixel % width;
                    for k in 0..channels {
                        let from = (offsets[k] + u64::from(pixel) * strides[k]) as usize;
                        samples[place as usize * 4 + k] = data[from];
                    }
                }
                updates += 1;
            }
            kind => panic!("packet of kind {kind}"),
        }
    }
}

#[test]
fn a_viewer_sees_every_tile() {
    let room = tempfile::tempdir().unwrap();
    let output = room.path().join("a.exr");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let host = listener.local_addr().unwrap().to_string();
    let viewer = thread::spawn(move || view(&listener));
    let done = octray()
        .args(["render", "scenes/fig5.toml", "--resolution", "100x75", "--spp", "2", "--crop", "10,5,90,75", "--float"])
        .args(["--quiet", "--tev", &host, "-o"])
        .arg(&output)
        .output()
        .unwrap();
    assert!(done.status.success() && done.stderr.is_empty(), "{}", String::from_utf8_lossy(&done.stderr));
    let (size, samples, updates) = viewer.join().unwrap();
    let picture = octray::output::read(&output).unwrap();
    assert_eq!((size, updates), ((80, 70), 9));
    assert_eq!(samples, picture.pixels.as_flattened());
}

#[test]
fn a_render_needs_no_viewer() {
    let room = tempfile::tempdir().unwrap();
    let output = room.path().join("a.exr");
    // Nobody listens on a port that was just given back.
    let host = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let done = octray()
        .args(["render", "scenes/fig5.toml", "--resolution", "20x15", "--spp", "1", "--tev", &host, "-o"])
        .arg(&output)
        .output()
        .unwrap();
    assert!(done.status.success() && output.exists());
    assert!(String::from_utf8_lossy(&done.stderr).contains("rendering without a viewer"));
}

fn wait_for(path: &Path) {
    let start = Instant::now();
    while !path.exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "{} does not come", path.display());
        thread::sleep(Duration::from_millis(20));
    }
}

/// SIGUSR1 writes what there is beside the name that stands for a whole picture, and the render goes on.
#[cfg(unix)]
#[test]
fn a_signal_shows_the_picture_so_far() {
    let room = tempfile::tempdir().unwrap();
    let (output, partial) = (room.path().join("a.exr"), room.path().join("a.partial.exr"));
    let mut child = octray()
        .args(["render", "scenes/mixed.toml", "--resolution", "640x480", "--spp", "4096", "-t", "1", "--quiet"])
        .args(["--aov", "depth", "-o"])
        .arg(&output)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The first blocks take some tenths of a second each; a signal before the watch begins would end it.
    thread::sleep(Duration::from_millis(500));
    let id = child.id().to_string();
    let signal = |name: &str| Command::new("kill").args([name, &id]).status().unwrap();
    assert!(signal("-USR1").success());
    wait_for(&partial);
    let picture = octray::output::read(&partial).unwrap();
    let seen = picture.pixels.iter().filter(|pixel| **pixel != [0.0; 4]).count();
    assert!(seen >= 1024 && seen < picture.pixels.len(), "{seen}");
    // What is not rendered yet is as far away as what rays miss.
    let depth = picture.channel("depth.Z").and_then(|channel| channel.samples.floats()).unwrap();
    let unseen = picture.pixels.iter().zip(&*depth).filter(|(pixel, _)| **pixel == [0.0; 4]);
    assert!(unseen.clone().count() > 1024 && unseen.clone().all(|(_, depth)| *depth == 1e10));
    assert!(depth.iter().all(|depth| *depth > 0.0));
    assert!(!output.exists());
    assert_eq!(child.try_wait().unwrap(), None, "it goes on");
    assert!(signal("-TERM").success());
    child.wait().unwrap();
}

#[cfg(unix)]
#[test]
fn a_signal_shows_a_picture_of_a_batch() {
    let room = tempfile::tempdir().unwrap();
    let (list, partial) = (room.path().join("list.jsonl"), room.path().join("a.partial.exr"));
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/mixed.toml");
    let job = serde_json::json!({ "scene": scene, "output": "a.exr", "resolution": [640, 480], "spp": 4096 });
    std::fs::write(&list, job.to_string()).unwrap();
    let mut child =
        octray().args(["batch", "--quiet", "-t", "1", "--out-dir"]).arg(room.path()).arg(&list).spawn().unwrap();
    thread::sleep(Duration::from_millis(500));
    let id = child.id().to_string();
    let signal = |name: &str| Command::new("kill").args([name, &id]).status().unwrap();
    assert!(signal("-USR1").success());
    wait_for(&partial);
    assert!(signal("-TERM").success());
    child.wait().unwrap();
}
