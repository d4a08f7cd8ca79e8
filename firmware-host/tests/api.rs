//! The API over a real socket: routes, refusals, and a page that needs nothing from elsewhere.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use common::{Bench, stored};
use demeter::api::Api;
use demeter::pipeline::Views;
use demeter::report::Document;
use demeter::status::{Activity, CameraStatus, Health, Reason, Status};
use demeter::sync::Attendant;
use demeter_capture::{CameraHealth, decode_photo};
use demeter_frame::{CameraId, Frame, PixelFormat, Stamp};
use metrics_exporter_prometheus::PrometheusBuilder;
use serde_json::{Value, json};
use tokio::sync::watch;

/// A server that lives as long as this.
struct Server {
    bench: Bench,
    status: watch::Sender<Status>,
    views: Views,
    address: SocketAddr,
    _runtime: tokio::runtime::Runtime,
}

struct Answer {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Answer {
    fn json(&self) -> Value {
        assert!(self.head.contains("content-type: application/json"), "{}", self.head);
        serde_json::from_slice(&self.body).unwrap()
    }

    fn error(&self) -> String {
        self.json()["error"]["kind"].as_str().unwrap().to_owned()
    }
}

fn server(plants: u32) -> Server {
    let bench = stored(plants);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let listener = runtime.block_on(tokio::net::TcpListener::bind("127.0.0.1:0")).unwrap();
    let address = listener.local_addr().unwrap();
    let status = watch::Sender::new(Status::default());
    let views = Views::default();
    let recorder = Arc::new(PrometheusBuilder::new().build_recorder());
    let api = Api::new(
        bench.store.reader().unwrap(),
        status.subscribe(),
        views.clone(),
        Attendant::default(),
        recorder,
        address,
    );
    runtime.spawn(api.serve(listener, std::future::pending()));
    Server { bench, status, views, address, _runtime: runtime }
}

impl Server {
    fn send(&self, request: &str) -> Answer {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = vec![];
        stream.read_to_end(&mut bytes).unwrap();
        let split = bytes.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
        let head = String::from_utf8(bytes[..split].to_vec()).unwrap().to_lowercase();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        Answer { status, head, body: bytes[split + 4..].to_vec() }
    }

    fn get(&self, path: &str) -> Answer {
        self.send(&format!("GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address))
    }
}

#[test]
fn health_status_and_metrics_tell_what_the_store_holds() {
    let server = server(3);
    assert_eq!(server.get("/healthz").body, b"ok\n");
    let status = server.get("/api/v1/status").json();
    assert_eq!(status["activity"]["state"], "idle");
    assert_eq!((&status["store"]["plants"], &status["store"]["unsent"]), (&3.into(), &3.into()));
    assert_eq!((&status["health"], &status["reasons"]), (&"works".into(), &json!([])));
    let why = Reason { health: Health::Broken, kind: "pipeline", message: "the camera burnt".into() };
    server.status.send_modify(|status| {
        status.activity = Activity::Failed(why.message.clone());
        (status.health, status.reasons) = (why.health, vec![why]);
    });
    let status = server.get("/api/v1/status").json();
    assert_eq!(status["activity"]["message"], "the camera burnt");
    let why = json!({"health": "broken", "kind": "pipeline", "message": "the camera burnt"});
    assert_eq!((&status["health"], &status["reasons"]), (&"broken".into(), &json!([why])));
    let metrics = String::from_utf8(server.get("/metrics").body).unwrap();
    assert!(metrics.contains("demeter_plants 3"), "{metrics}");
}

#[test]
fn plants_are_listed_by_page_and_shown_as_the_contract_says() {
    let server = server(3);
    let first = server.get("/api/v1/plants?limit=2").json();
    assert_eq!(first["plants"][0]["id"], "row-0003");
    let second = server.get(&format!("/api/v1/plants?limit=2&cursor={}", first["next"])).json();
    assert_eq!((&second["plants"][0]["id"], &second["next"]), (&"row-0001".into(), &Value::Null));

    let shown = server.get("/api/v1/plants/row-0002").json();
    let schema = serde_json::from_str(include_str!("../../docs/plant.schema.json")).unwrap();
    jsonschema::validator_for(&schema).unwrap().validate(&shown).unwrap();
    let document: Document = serde_json::from_value(shown).unwrap();
    assert_eq!(document.plants[0].organs.len(), 2);

    let plant = server.bench.plant(2);
    assert_eq!(server.get("/api/v1/plants/row-0002/record").body, plant.record);
    let thumbnail = server.get("/api/v1/plants/row-0002/thumbnail");
    assert_eq!(Some(thumbnail.body), plant.thumbnail);
    assert!(thumbnail.head.contains("content-type: image/png"));
    let mesh = server.get("/api/v1/plants/row-0002/mesh.glb");
    assert!(mesh.head.contains("content-type: model/gltf-binary"), "{}", mesh.head);
    assert_eq!(mesh.body[..4], *b"glTF");
    let length = u32::from_le_bytes(mesh.body[8..12].try_into().unwrap());
    assert_eq!(length as usize, mesh.body.len());
}

#[test]
fn a_live_store_is_seen_and_a_damaged_record_breaks_only_its_mesh() {
    let server = server(1);
    server.bench.store.save_plant(&server.bench.plant(2)).unwrap();
    assert_eq!(server.get("/api/v1/status").json()["store"]["plants"], 2);
    let other = rusqlite::Connection::open(&server.bench.path).unwrap();
    other.execute("UPDATE plants SET record = x'00' WHERE id = 'row-0001'", []).unwrap();
    let broken = server.get("/api/v1/plants/row-0001/mesh.glb");
    assert_eq!((broken.status, broken.error()), (500, "store".into()));
    assert_eq!(server.get("/api/v1/plants/row-0002/mesh.glb").status, 200);
}

#[test]
fn what_is_not_there_or_not_understood_is_a_json_error() {
    let server = server(1);
    for (path, status) in [
        ("/api/v1/plants/row-9999", 404),
        ("/api/v1/plants/row-9999/mesh.glb", 404),
        ("/api/v1/plants/row-9999/record", 404),
        ("/api/v1/plants/row-9999/thumbnail", 404),
        ("/api/v1/plants/", 404),
        ("/api/v1/plants/row-0001/mesh.obj", 404),
        ("/api/v1/nothing", 404),
        ("/nothing", 404),
        ("/api/v1/plants/%ff", 400),
        ("/api/v1/plants?cursor=99999999999999999999999999", 400),
        ("/api/v1/plants?cursor=x", 400),
        ("/api/v1/plants?limit=-1", 400),
        ("/api/v1/plants?page=2", 400),
    ] {
        let answer = server.get(path);
        assert_eq!(answer.status, status, "{path}");
        answer.error();
    }
    for cursor in [i64::MIN, i64::MAX] {
        assert_eq!(server.get(&format!("/api/v1/plants?cursor={cursor}&limit={}", u32::MAX)).status, 200);
    }
    assert_eq!(server.get("/api/v1/plants?limit=0").json()["plants"].as_array().unwrap().len(), 1);
    let host = server.address;
    for method in ["POST", "PUT", "DELETE", "PATCH"] {
        let request = format!("{method} /api/v1/plants HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        let answer = server.send(&request);
        assert_eq!((answer.status, answer.error()), (405, "method".into()), "{method}");
    }
}

#[test]
fn only_this_machines_own_names_are_answered() {
    let server = server(1);
    let port = server.address.port();
    let with = |host: &str| {
        let host = if host.is_empty() { String::new() } else { format!("Host: {host}\r\n") };
        server.send(&format!("GET /api/v1/status HTTP/1.1\r\n{host}Connection: close\r\n\r\n")).status
    };
    for good in ["localhost", "127.0.0.1", "[::1]"] {
        assert_eq!((with(good), with(&format!("{good}:{port}"))), (200, 200), "{good}");
    }
    for bad in [
        "",
        "evil.example",
        "localhost.evil.example",
        "127.0.0.1.evil.example",
        "evil.example:8420",
        "localhost:1",
        "user@localhost",
        "0.0.0.0",
        "127.0.0.2",
        "localhost, evil.example",
    ] {
        assert_eq!(with(bad), 403, "`{bad}`");
    }
}

#[test]
fn no_path_reaches_a_file() {
    let server = server(1);
    // Something to find, beside the store.
    std::fs::write(server.bench.folder.path().join("secret.txt"), "root:x:0:0").unwrap();
    let up =
        ["../", "..%2f", "%2e%2e/", "%2e%2e%2f", "..\\", "..%5c", "....//", "%252e%252e%252f", "..%c0%af", "./.././"];
    let targets = ["etc/passwd", "secret.txt", "demeter.sqlite", "proc/self/environ", "etc/passwd%00.png"];
    let mut tried = 0;
    for base in ["/", "/vendor/", "/api/v1/plants/", "/api/v1/plants/row-0001/", "//"] {
        for up in up {
            for target in targets {
                for depth in [1, 8] {
                    let path = format!("{base}{}{target}", up.repeat(depth));
                    let answer = server.get(&path);
                    assert!([400, 404].contains(&answer.status), "{path}: {}", answer.status);
                    let body = String::from_utf8_lossy(&answer.body);
                    assert!(!body.contains("root:") && !body.contains("SQLite format"), "{path}: {body}");
                    tried += 1;
                }
            }
        }
    }
    assert_eq!(tried, 500);
}

#[test]
fn every_answer_has_the_security_headers() {
    let server = server(1);
    for path in ["/", "/api/v1/status", "/nothing", "/app.js"] {
        let head = server.get(path).head;
        for part in [
            "content-security-policy: default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src",
            "x-content-type-options: nosniff",
            "x-frame-options: deny",
            "referrer-policy: no-referrer",
            "cache-control: no-store",
        ] {
            assert!(head.contains(part), "{path}: {part} in {head}");
        }
    }
}

#[test]
fn the_page_is_whole_and_asks_nobody_else() {
    let server = server(1);
    let page = String::from_utf8(server.get("/").body).unwrap();
    let mut files = vec![];
    for attribute in ["src=\"", "href=\""] {
        files.extend(page.split(attribute).skip(1).map(|rest| rest.split('"').next().unwrap().to_owned()));
    }
    files.retain(|file| !file.starts_with("data:"));
    assert_eq!(files, ["vendor/model-viewer.min.js", "app.js", "style.css"]);
    for file in &files {
        assert_eq!(server.get(&format!("/{file}")).status, 200, "{file}");
    }
    for ours in ["/", "/app.js", "/style.css"] {
        let text = String::from_utf8(server.get(ours).body).unwrap();
        assert!(!text.contains("://") && !text.contains("\"//"), "{ours} names another host");
    }
}

#[test]
fn cameras_are_shown_with_the_last_good_frame_which_is_encoded_once_a_second() {
    let server = server(1);
    assert_eq!(server.get("/api/v1/cameras").json(), json!({"cameras": []}));
    let none = server.get("/api/v1/cameras/left/preview.jpg");
    assert_eq!((none.status, none.error()), (404, "not_found".into()));
    let health = CameraHealth { frames: 7, rate: Some(14.9), ..CameraHealth::new(CameraId("left".into()), "usb-1") };
    let camera = CameraStatus { health, lens: Some("covered".into()) };
    server.status.send_modify(|status| status.cameras = vec![camera]);
    let left = &server.get("/api/v1/cameras").json()["cameras"][0];
    assert_eq!((&left["id"], &left["frames"], &left["lens"]), (&"left".into(), &7.into(), &"covered".into()));

    let frame = |width: u32, height: u32| Frame {
        camera: CameraId("left".into()),
        seq: 0,
        stamp: Stamp { mono_ns: 0, wall: String::new(), boot_id: String::new() },
        format: PixelFormat::Grey,
        width,
        height,
        stride: width,
        bytes: vec![99; (width * height) as usize].into(),
        world_from_camera: None,
    };
    server.views.show(&frame(1280, 960));
    let preview = server.get("/api/v1/cameras/left/preview.jpg");
    assert!(preview.head.contains("content-type: image/jpeg"), "{}", preview.head);
    let size = |jpeg: &[u8]| decode_photo(jpeg).map(|picture| picture.dimensions()).unwrap();
    assert_eq!(size(&preview.body), (640, 480));
    // Within the second nothing is encoded anew, whatever the camera gives; after it the newest frame is.
    server.views.show(&frame(320, 200));
    assert_eq!(server.get("/api/v1/cameras/left/preview.jpg").body, preview.body);
    std::thread::sleep(Duration::from_millis(1100));
    assert_eq!(size(&server.get("/api/v1/cameras/left/preview.jpg").body), (320, 200));
}

#[test]
fn the_document_of_the_api_names_every_route_and_tells_the_truth() {
    let server = server(1);
    let document = server.get("/openapi.json").json();
    let told: BTreeSet<_> = document["paths"].as_object().unwrap().keys().map(String::as_str).collect();
    // Routes stand in three files, one call or one line of a table each.
    let sources = [include_str!("../src/api/mod.rs"), include_str!("../src/api/page.rs")].concat();
    let path = |text: &&str| text.starts_with('/') && text.len() > 1 && !text.starts_with("//") && *text != "/api/v1";
    let quoted = sources.split('"').filter(path);
    let page = ["/app.js", "/style.css", "/vendor/model-viewer.min.js"];
    let beside = ["/healthz", "/metrics", "/openapi.json"];
    let routes: Vec<_> = quoted
        .filter(|path| !page.contains(path))
        .map(|path| if beside.contains(&path) { path.to_owned() } else { format!("/api/v1{path}") })
        .collect();
    assert_eq!(told, routes.iter().map(String::as_str).collect());
    for (path, item) in document["paths"].as_object().unwrap() {
        let Some(responses) = item.get("get").map(|get| &get["responses"]) else { continue };
        let answer = server.get(&path.replace("{id}", "row-0001"));
        let response = &responses[answer.status.to_string()]["content"];
        let (media, content) = response.as_object().unwrap().iter().next().unwrap();
        assert!(answer.head.contains(&format!("content-type: {media}")), "{path}: {}", answer.head);
        if media == "application/json" {
            let mut schema = content["schema"].clone();
            schema["components"] = document["components"].clone();
            let told = jsonschema::validator_for(&schema).unwrap();
            told.validate(&answer.json()).unwrap_or_else(|error| panic!("{path}: {error}"));
        }
    }
}

#[test]
fn the_sync_is_shown_and_asked_for_but_not_by_a_page_elsewhere() {
    let server = server(3);
    let answer = server.get("/api/v1/sync").json();
    assert_eq!((&answer["outbox"]["waiting"], &answer["report"]["asked"]), (&3.into(), &0.into()));
    let post = |origin: &str| {
        let line = if origin.is_empty() { String::new() } else { format!("Origin: {origin}\r\n") };
        let host = server.address;
        let close = "Connection: close\r\nContent-Length: 0";
        server.send(&format!("POST /api/v1/sync/run HTTP/1.1\r\nHost: {host}\r\n{line}{close}\r\n\r\n"))
    };
    for origin in ["https://evil.example", "http://127.0.0.1:1", "null", "http://localhost.evil.example"] {
        let answer = post(origin);
        assert_eq!((answer.status, answer.error()), (403, "forbidden".into()), "{origin}");
    }
    assert_eq!(post("").status, 202);
    let ours = post(&format!("http://{}", server.address));
    assert_eq!((ours.status, &ours.json()["asked"]), (202, &2.into()));
}
