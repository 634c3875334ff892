//! Looking on while a picture is rendered: the bar, the tev viewer, and what SIGUSR1 asks for.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use octray::Renderer;
use octray::batch::{Fresh, Job};
use octray::film::Window;
use octray::output::Format;
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use super::Run;
use super::pictures::{self, Target};

/// A viewer that takes nothing for so long is given up.
const PATIENCE: Duration = Duration::from_secs(5);
const CHANNELS: [&str; 4] = ["R", "G", "B", "A"];

/// What goes on beside a render.
pub struct Preview<'a> {
    host: Option<&'a str>,
    tev: OnceLock<Option<Tev>>,
    run: &'a Run,
}

impl<'a> Preview<'a> {
    /// With the viewer that the user asked for, where there is but one picture.
    pub fn new(run: &'a Run, host: Option<&'a str>) -> Self {
        Preview { host, tev: OnceLock::new(), run }
    }

    /// Shows a block, and writes what there is so far of its picture where SIGUSR1 came.
    pub fn block(&self, job: &Job, renderer: &Renderer, fresh: &Fresh) {
        if let Some(tev) = self.tev.get_or_init(|| self.open(job, renderer)) {
            tev.show(fresh.window, fresh.pixels);
        }
        if self.run.signals.is_asked() {
            self.write(job, fresh);
        }
    }

    /// A render goes on without a viewer that does not answer.
    fn open(&self, job: &Job, renderer: &Renderer) -> Option<Tev> {
        let (host, window) = (self.host?, renderer.window().ok()?);
        let told = |error: io::Error| {
            self.run.console.warn(&format!("--tev {host}: {error}: rendering without a viewer"));
        };
        Tev::open(host, &job.to_string(), window).map_err(told).ok()
    }

    /// Writes what there is so far beside the target, whose own name stays that of a whole picture.
    fn write(&self, job: &Job, fresh: &Fresh) {
        let ending = if job.format == Format::Exr { "partial.exr" } else { "partial.png" };
        let name = match job.output.as_os_str() == "-" {
            true => PathBuf::from("octray.partial.exr"),
            false => job.output.with_extension(ending),
        };
        let target = Target::new(&name, &[&job.scene], self.run);
        let written = target.and_then(|target| pictures::put((fresh.so_far)(&name), &target, self.run));
        match written {
            Ok(()) => self.run.console.note(&format!("{}: the picture so far", name.display())),
            Err(failure) => self.run.console.warn(&failure.message),
        }
    }
}

/// A picture in the tev viewer (Müller, "tev", its protocol over TCP), fed by a thread of its own.
pub struct Tev {
    host: String,
    blocks: Option<Mutex<Sender<Block>>>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

struct Block {
    window: Window,
    samples: Vec<f32>,
}

impl Tev {
    /// Opens a picture of this name that is as large as the window.
    ///
    /// # Errors
    /// Nobody listens there.
    pub fn open(host: &str, name: &str, window: Window) -> io::Result<Tev> {
        let mut client = TevClient::wrap(connect(host)?);
        let size = |pixels: usize| u32::try_from(pixels).map_err(io::Error::other);
        let (width, height) = (size(window.width())?, size(window.height())?);
        let (image_name, channel_names) = (name, &CHANNELS[..]);
        client.send(PacketCreateImage { image_name, grab_focus: false, width, height, channel_names })?;
        let (sender, blocks) = mpsc::channel();
        let name = name.to_owned();
        let thread = thread::Builder::new().spawn(move || feed(client, &name, window, &blocks))?;
        Ok(Tev { host: host.to_owned(), blocks: Some(Mutex::new(sender)), thread: Some(thread) })
    }

    fn show(&self, window: Window, pixels: &[[f32; 4]]) {
        let Some(blocks) = &self.blocks else { return };
        let blocks = blocks.lock().unwrap_or_else(PoisonError::into_inner);
        // Where the viewer is gone, nobody listens.
        let _ = blocks.send(Block { window, samples: pixels.as_flattened().to_vec() });
    }

    /// Waits until all is shown.
    ///
    /// # Errors
    /// The viewer went away.
    fn close(&mut self) -> io::Result<()> {
        self.blocks = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            _ => Ok(()),
        }
    }
}

impl Preview<'_> {
    /// Ends it, with a warning where the viewer went away.
    pub fn finish(self) {
        let Preview { tev, run, .. } = self;
        let Some(mut tev) = tev.into_inner().flatten() else { return };
        if let Err(error) = tev.close() {
            run.console.warn(&format!("--tev {}: the viewer went away: {error}", tev.host));
        }
    }
}

fn connect(host: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "no such host");
    for address in host.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => {
                stream.set_write_timeout(Some(PATIENCE))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

fn feed(mut client: TevClient, name: &str, picture: Window, blocks: &Receiver<Block>) -> io::Result<()> {
    for Block { window, samples } in blocks {
        let place = |at: i32, start: i32| u32::try_from(at - start).map_err(io::Error::other);
        client.send(PacketUpdateImage {
            image_name: name,
            grab_focus: false,
            channel_names: &CHANNELS,
            channel_offsets: &[0, 1, 2, 3],
            channel_strides: &[4; 4],
            x: place(window.x0, picture.x0)?,
            y: place(window.y0, picture.y0)?,
            width: window.width() as u32,
            height: window.height() as u32,
            data: &samples,
        })?;
    }
    Ok(())
}
