//! A server that stores objects and can do everything wrong that a server can: real TCP, real TLS.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use rustls::{ServerConfig, ServerConnection, StreamOwned};

/// What is wrong with an answer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Fault {
    /// Nothing.
    None,
    /// This status, and a body that quotes the request's token.
    Status(u16),
    /// 307 to there.
    Redirect(String),
    /// The connection closes before anything is stored.
    Drop,
    /// The request is read to somewhere in its body, then the connection closes.
    Cut,
    /// It is stored, then the connection closes without an answer.
    CommitThenDrop,
    /// The answer says that it was stored, and it was not.
    WrongAcknowledgement,
    /// Half of the body is stored, and acknowledged.
    StoredHalf,
    /// The answer's body breaks off.
    Partial,
    /// The object comes back with a flipped bit.
    Flipped,
    /// No HTTP at all.
    Garbage,
    /// The answer comes a few milliseconds late, byte by byte.
    Slow,
    /// This status with a body of 10 GB, or one that never ends.
    Huge(u16, bool),
}

/// A request as it came.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    pub(crate) number: u64,
    pub(crate) method: String,
    pub(crate) path: String,
    pub(crate) headers: String,
    pub(crate) body: usize,
}

/// What answers in place of the objects: request and body give status and body. `true` where it must say that all is
/// well and do nothing.
type Answer = Box<dyn Fn(&Request, &[u8], bool) -> (u16, Vec<u8>) + Send + Sync>;
type Plan = Box<dyn Fn(&Request) -> Fault + Send + Sync>;

/// The server; it lives as long as this.
pub(crate) struct Depot {
    pub(crate) address: SocketAddr,
    shared: Arc<Shared>,
}

struct Shared {
    tls: Option<Arc<ServerConfig>>,
    plan: Mutex<Plan>,
    answer: Option<Answer>,
    objects: Mutex<BTreeMap<String, Vec<u8>>>,
    requests: Mutex<Vec<Request>>,
    /// Connections, bytes that came in clear text or out of TLS, and bytes that went out.
    connections: AtomicU64,
    received: AtomicU64,
    sent: AtomicU64,
    over: AtomicBool,
}

impl Depot {
    pub(crate) fn start(tls: Option<ServerConfig>, plan: impl Fn(&Request) -> Fault + Send + Sync + 'static) -> Self {
        Self::listen(tls, Box::new(plan), None)
    }

    /// A server of something else than objects.
    pub(crate) fn with(answer: impl Fn(&Request, &[u8], bool) -> (u16, Vec<u8>) + Send + Sync + 'static) -> Self {
        Self::listen(None, Box::new(|_| Fault::None), Some(Box::new(answer)))
    }

    fn listen(tls: Option<ServerConfig>, plan: Plan, answer: Option<Answer>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let shared = Arc::new(Shared {
            tls: tls.map(Arc::new),
            plan: Mutex::new(plan),
            answer,
            objects: Mutex::default(),
            requests: Mutex::default(),
            connections: AtomicU64::new(0),
            received: AtomicU64::new(0),
            sent: AtomicU64::new(0),
            over: AtomicBool::new(false),
        });
        let ours = shared.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                if ours.over.load(Ordering::Relaxed) {
                    return;
                }
                let ours = ours.clone();
                // A client that goes away in the middle is what many of these tests are about.
                std::thread::spawn(move || ours.serve(stream).ok());
            }
        });
        Self { address, shared }
    }

    pub(crate) fn plan(&self, plan: impl Fn(&Request) -> Fault + Send + Sync + 'static) {
        *self.shared.plan.lock().unwrap() = Box::new(plan);
    }

    /// What it stores, by path below its root.
    pub(crate) fn objects(&self) -> BTreeMap<String, Vec<u8>> {
        self.shared.objects.lock().unwrap().clone()
    }

    pub(crate) fn requests(&self) -> Vec<Request> {
        self.shared.requests.lock().unwrap().clone()
    }

    pub(crate) fn connections(&self) -> u64 {
        self.shared.connections.load(Ordering::SeqCst)
    }

    pub(crate) fn received(&self) -> u64 {
        self.shared.received.load(Ordering::SeqCst)
    }

    pub(crate) fn sent(&self) -> u64 {
        self.shared.sent.load(Ordering::SeqCst)
    }
}

impl Drop for Depot {
    fn drop(&mut self) {
        self.shared.over.store(true, Ordering::Relaxed);
        TcpStream::connect(self.address).ok();
    }
}

trait Wire: Read + Write {}
impl<T: Read + Write> Wire for T {}

impl Shared {
    fn serve(&self, tcp: TcpStream) -> std::io::Result<()> {
        self.connections.fetch_add(1, Ordering::SeqCst);
        tcp.set_read_timeout(Some(Duration::from_secs(20)))?;
        tcp.set_write_timeout(Some(Duration::from_secs(20)))?;
        tcp.set_nodelay(true)?;
        let wire: Box<dyn Wire> = match &self.tls {
            None => Box::new(tcp),
            Some(tls) => {
                let session = ServerConnection::new(tls.clone()).map_err(std::io::Error::other)?;
                Box::new(StreamOwned::new(session, tcp))
            }
        };
        let mut wire = BufReader::new(wire);
        while self.answer(&mut wire)? {}
        wire.get_mut().flush()
    }

    /// One request; false when the connection closes after it.
    fn answer(&self, wire: &mut BufReader<Box<dyn Wire>>) -> std::io::Result<bool> {
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            let read = wire.read_line(&mut head)?;
            self.received.fetch_add(read as u64, Ordering::SeqCst);
            if read == 0 {
                return Ok(false);
            }
        }
        let (line, headers) = head.split_once("\r\n").unwrap();
        let mut words = line.split(' ');
        let mut word = || words.next().unwrap_or_default().to_owned();
        let (method, path) = (word(), word());
        let length = headers.lines().find_map(|l| l.to_lowercase().strip_prefix("content-length:").map(str::to_owned));
        let length: usize = length.map_or(0, |text| text.trim().parse().unwrap());
        let request = {
            let mut requests = self.requests.lock().unwrap();
            let number = requests.len() as u64;
            requests.push(Request { number, method, path, headers: headers.to_owned(), body: length });
            requests[number as usize].clone()
        };
        let fault = (self.plan.lock().unwrap())(&request);
        let mut body = vec![0; if fault == Fault::Cut { length / 2 } else { length }];
        wire.read_exact(&mut body)?;
        self.received.fetch_add(body.len() as u64, Ordering::SeqCst);
        let mut out = Vec::new();
        let status = match (&fault, request.method.as_str()) {
            (Fault::Drop | Fault::Cut, _) => return Ok(false),
            (Fault::Garbage, _) => {
                self.send(wire, b"\x16\x03\x01 what? 200 OK \r\r\n\0\0")?;
                return Ok(false);
            }
            (Fault::Huge(status, announced), _) => {
                self.flood(wire, *status, *announced)?;
                return Ok(false);
            }
            (Fault::Status(status), _) => {
                let quoted = headers.lines().find(|line| line.to_lowercase().starts_with("authorization"));
                out = format!("no: you said {quoted:?}").into_bytes();
                *status
            }
            (Fault::Redirect(_), _) => 307,
            _ if let Some(answer) = &self.answer => {
                let (status, answered) = answer(&request, &body, fault == Fault::WrongAcknowledgement);
                out = answered;
                status
            }
            (_, "PUT") => {
                let half = body[..body.len() / 2].to_vec();
                match fault {
                    Fault::WrongAcknowledgement => None,
                    Fault::StoredHalf => self.objects.lock().unwrap().insert(request.path.clone(), half),
                    _ => self.objects.lock().unwrap().insert(request.path.clone(), body),
                };
                200
            }
            (_, "GET") => match self.objects.lock().unwrap().get(&request.path) {
                Some(object) => {
                    out.clone_from(object);
                    200
                }
                None => 404,
            },
            (_, "PROPFIND") => match self.listing(&request.path) {
                Some(listing) => {
                    out = listing.into_bytes();
                    207
                }
                None => 404,
            },
            _ => 405,
        };
        if fault == Fault::CommitThenDrop {
            return Ok(false);
        }
        if let (Fault::Flipped, Some(byte)) = (&fault, out.last_mut()) {
            *byte ^= 1;
        }
        let location = if let Fault::Redirect(to) = &fault { format!("Location: {to}\r\n") } else { String::new() };
        let head = format!(
            "HTTP/1.1 {status} x\r\nContent-Length: {}\r\nETag: \"1\"\r\n{location}\
             Last-Modified: Mon, 01 Jun 2026 10:00:00 GMT\r\n\r\n",
            out.len()
        );
        if fault == Fault::Partial {
            self.send(wire, &[head.as_bytes(), &out[..out.len() / 2]].concat())?;
            return Ok(false);
        }
        if fault == Fault::Slow {
            for byte in head.as_bytes().chunks(16) {
                self.send(wire, byte)?;
                std::thread::sleep(Duration::from_millis(1));
            }
            self.send(wire, &out)?;
        } else {
            self.send(wire, &[head.as_bytes(), &out].concat())?;
        }
        Ok(true)
    }

    /// What lies below a folder that is there, as WebDAV says it.
    fn listing(&self, folder: &str) -> Option<String> {
        let objects = self.objects.lock().unwrap();
        let objects = objects.iter().filter(|(path, _)| path.starts_with(&format!("{folder}/")));
        let line = |(path, object): (&String, &Vec<u8>)| {
            format!(
                "<D:response><D:href>{path}</D:href><D:propstat><D:status>HTTP/1.1 200 OK</D:status><D:prop>\
                 <D:getlastmodified>Mon, 01 Jun 2026 10:00:00 GMT</D:getlastmodified><D:resourcetype/>\
                 <D:getcontentlength>{}</D:getcontentlength></D:prop></D:propstat></D:response>",
                object.len()
            )
        };
        let lines: String = objects.map(line).collect();
        (!lines.is_empty()).then(|| format!("<D:multistatus xmlns:D=\"DAV:\">{lines}</D:multistatus>"))
    }

    fn send(&self, wire: &mut BufReader<Box<dyn Wire>>, bytes: &[u8]) -> std::io::Result<()> {
        wire.get_mut().write_all(bytes)?;
        wire.get_mut().flush()?;
        self.sent.fetch_add(bytes.len() as u64, Ordering::SeqCst);
        Ok(())
    }

    /// 10 GB, announced or in chunks without an end.
    fn flood(&self, wire: &mut BufReader<Box<dyn Wire>>, status: u16, announced: bool) -> std::io::Result<()> {
        let size = 10_u64 << 30;
        let how = if announced { format!("Content-Length: {size}") } else { "Transfer-Encoding: chunked".into() };
        let head = format!(
            "HTTP/1.1 {status} x\r\n{how}\r\nETag: \"1\"\r\nLast-Modified: Mon, 01 Jun 2026 10:00:00 GMT\r\n\r\n"
        );
        self.send(wire, head.as_bytes())?;
        let zeros = vec![b'0'; 8 << 10];
        for _ in 0..size / zeros.len() as u64 {
            if !announced {
                self.send(wire, b"2000\r\n")?;
            }
            self.send(wire, &zeros)?;
            if !announced {
                self.send(wire, b"\r\n")?;
            }
        }
        Ok(())
    }
}
