//! The one door to the kernel: calls that the crate v4l lacks, or makes in a way that can panic.
#![allow(unsafe_code, reason = "the kernel takes pointers to structures")]

use std::io;
use std::mem;

use v4l::device::Handle;
use v4l::v4l_sys::{v4l2_buffer, v4l2_capability, v4l2_requestbuffers};
use v4l::v4l2::{self, vidioc};

/// Structures of the kernel's interface of which every pattern of bits is a value.
///
/// # Safety
/// The type is plain old data, and `code` is a call that reads and writes exactly one of it.
unsafe trait Argument: Sized {
    fn call(&mut self, handle: &Handle, code: vidioc::_IOC_TYPE) -> io::Result<()> {
        loop {
            // SAFETY: the pointer is to a live value of the type that the call was made for, by this trait's contract.
            match unsafe { v4l2::ioctl(handle.fd(), code, std::ptr::from_mut(self).cast()) } {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                done => return done,
            }
        }
    }
}

// SAFETY: a C structure of numbers and arrays, used with VIDIOC_QUERYCAP alone.
unsafe impl Argument for v4l2_capability {}
// SAFETY: a C structure of numbers, used with VIDIOC_REQBUFS alone.
unsafe impl Argument for v4l2_requestbuffers {}
// SAFETY: a C structure of numbers and unions of them, used with VIDIOC_QUERYBUF, QBUF and DQBUF. Its pointers are only
// followed for memory kinds that are not used here.
unsafe impl Argument for v4l2_buffer {}
// SAFETY: a buffer type, used with VIDIOC_STREAMON and STREAMOFF.
unsafe impl Argument for i32 {}

/// What the driver says of its device.
pub(super) struct Capability {
    pub(super) driver: String,
    pub(super) card: String,
    pub(super) bus: String,
    /// Of this node alone, `V4L2_CAP_..`.
    pub(super) flags: u32,
}

/// As `Device::query_caps`, but names need not be UTF-8: webcams' are cut off anywhere.
pub(super) fn capability(handle: &Handle) -> io::Result<Capability> {
    // SAFETY: plain old data.
    let mut found: v4l2_capability = unsafe { mem::zeroed() };
    found.call(handle, vidioc::VIDIOC_QUERYCAP)?;
    let text = |bytes: &[u8]| {
        let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
        String::from_utf8_lossy(&bytes[..end]).into_owned()
    };
    let [driver, card, bus] = [&found.driver[..], &found.card[..], &found.bus_info[..]].map(text);
    Ok(Capability { driver, card, bus, flags: found.device_caps })
}

/// Asks for so many buffers to map; the driver may give more or fewer. 0 gives them back.
pub(super) fn request_buffers(handle: &Handle, count: u32) -> io::Result<u32> {
    // SAFETY: plain old data.
    let mut request: v4l2_requestbuffers = unsafe { mem::zeroed() };
    (request.count, request.type_, request.memory) = (count, CAPTURE, MMAP);
    request.call(handle, vidioc::VIDIOC_REQBUFS)?;
    Ok(request.count)
}

/// The driver's buffers seen from here, mapped one by one; unmapped when dropped.
pub(super) struct Mapped {
    start: *mut u8,
    len: usize,
}

impl Mapped {
    /// Maps the buffer of that index.
    pub(super) fn new(handle: &Handle, index: u32) -> io::Result<Self> {
        let mut buffer = buffer(index);
        buffer.call(handle, vidioc::VIDIOC_QUERYBUF)?;
        let len = buffer.length as usize;
        // SAFETY: for mapped memory the kernel fills in the union's offset.
        let offset = unsafe { buffer.m.offset };
        // SAFETY: a new shared mapping at an address of the kernel's choice, of the length and offset it gave.
        let start = unsafe {
            v4l2::mmap(std::ptr::null_mut(), len, libc::PROT_READ, libc::MAP_SHARED, handle.fd(), offset.into())?
        };
        Ok(Self { start: start.cast(), len })
    }

    /// A copy of the first `used` bytes, or of all there are. Only called between dequeuing and queuing the buffer, while
    /// the driver leaves it alone.
    pub(super) fn copy(&self, used: u32) -> Box<[u8]> {
        // SAFETY: the mapping is `len` bytes long and lives as long as this value.
        unsafe { std::slice::from_raw_parts(self.start, self.len.min(used as usize)) }.into()
    }
}

impl Drop for Mapped {
    fn drop(&mut self) {
        // SAFETY: the mapping is this value's own and nothing refers into it any more.
        if let Err(error) = unsafe { v4l2::munmap(self.start.cast(), self.len) } {
            tracing::error!("a camera's buffer stays mapped: {error}");
        }
    }
}

/// What comes back with a filled buffer.
pub(super) struct Filled {
    pub(super) index: u32,
    pub(super) used: u32,
    /// `V4L2_BUF_FLAG_..`.
    pub(super) flags: u32,
    pub(super) count: u32,
    /// Nanoseconds on the clock that the flags name.
    pub(super) stamp_ns: u64,
}

/// Hands a buffer to the driver.
pub(super) fn queue(handle: &Handle, index: u32) -> io::Result<()> {
    buffer(index).call(handle, vidioc::VIDIOC_QBUF)
}

/// Takes a filled buffer back. The device is open without blocking: with none filled, this says `WouldBlock`.
pub(super) fn dequeue(handle: &Handle) -> io::Result<Filled> {
    let mut buffer = buffer(0);
    buffer.call(handle, vidioc::VIDIOC_DQBUF)?;
    let (seconds, micros) = (buffer.timestamp.tv_sec.unsigned_abs(), buffer.timestamp.tv_usec.unsigned_abs());
    Ok(Filled {
        index: buffer.index,
        used: buffer.bytesused,
        flags: buffer.flags,
        count: buffer.sequence,
        stamp_ns: seconds.saturating_mul(1_000_000_000).saturating_add(micros.saturating_mul(1000)),
    })
}

pub(super) fn stream_on(handle: &Handle) -> io::Result<()> {
    (CAPTURE as i32).call(handle, vidioc::VIDIOC_STREAMON)
}

pub(super) fn stream_off(handle: &Handle) -> io::Result<()> {
    (CAPTURE as i32).call(handle, vidioc::VIDIOC_STREAMOFF)
}

const CAPTURE: u32 = v4l::buffer::Type::VideoCapture as u32;
const MMAP: u32 = v4l::memory::Memory::Mmap as u32;

fn buffer(index: u32) -> v4l2_buffer {
    // SAFETY: plain old data.
    let mut buffer: v4l2_buffer = unsafe { mem::zeroed() };
    (buffer.index, buffer.type_, buffer.memory) = (index, CAPTURE, MMAP);
    buffer
}
