//! The driver's lamp and buzzer: outputs of the kernel that take a number, such as /sys/class/leds/NAME/brightness.
//!
//! | | lamp | buzzer |
//! |---|---|---|
//! | works | lit | silent |
//! | degraded | one second on, one second off | one beep a minute |
//! | broken | fast | one beep every two seconds |
//! | no power, no program | dark | silent |

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::config::LampConfig;
use crate::status::Health;

/// How often the outputs are looked after: the shortest time that one is on or off.
pub(crate) const STEP: Duration = Duration::from_millis(250);

/// Shown for each health: so many steps on, and the length of the pattern in steps.
type Pattern = (u32, u32);

fn light(health: Health) -> Pattern {
    match health {
        Health::Works => (1, 1),
        Health::Degraded => (4, 8),
        Health::Broken => (1, 2),
    }
}

fn beep(health: Health) -> Pattern {
    match health {
        Health::Works => (0, 1),
        Health::Degraded => (1, 240),
        Health::Broken => (1, 8),
    }
}

/// Both outputs, as far as they are configured.
#[derive(Debug, Default)]
pub struct Lamp {
    outputs: Vec<Output>,
    step: u32,
}

#[derive(Debug)]
struct Output {
    path: PathBuf,
    pattern: fn(Health) -> Pattern,
    /// What the path takes for on: an LED's own maximum, or 1.
    on: String,
    lit: Option<bool>,
}

impl Lamp {
    /// The outputs that the configuration names.
    #[must_use]
    pub fn new(config: &LampConfig) -> Self {
        let outputs = [(&config.path, light as fn(_) -> _), (&config.buzzer, beep)].into_iter();
        let outputs = outputs.filter_map(|(path, pattern)| Some(Output::new(path.as_deref()?, pattern)));
        Self { outputs: outputs.collect(), step: 0 }
    }

    /// Shows the next [`STEP`] of the pattern; writes only what changes.
    ///
    /// # Errors
    /// The first output that could not be written, named; the others are.
    pub fn show(&mut self, health: Health) -> Result<(), LampError> {
        let step = self.step;
        self.step = self.step.wrapping_add(1);
        let lit = |output: &Output| {
            let (on, length) = (output.pattern)(health);
            step % length < on
        };
        self.set(lit)
    }

    /// Puts everything out.
    ///
    /// # Errors
    /// As [`Lamp::show`].
    pub fn dark(&mut self) -> Result<(), LampError> {
        self.set(|_| false)
    }

    fn set(&mut self, lit: impl Fn(&Output) -> bool) -> Result<(), LampError> {
        let mut failed = Ok(());
        for output in &mut self.outputs {
            let lit = lit(output);
            if output.lit == Some(lit) {
                continue;
            }
            // Opened and not made: a name that is wrong must not leave a file behind.
            let file = fs::OpenOptions::new().write(true).truncate(true).open(&output.path);
            let value = if lit { &output.on } else { "0" };
            match file.and_then(|mut file| file.write_all(value.as_bytes())) {
                Ok(()) => output.lit = Some(lit),
                Err(source) => failed = failed.and(Err(LampError { path: output.path.clone(), source })),
            }
        }
        failed
    }
}

/// An output cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("lamp {path}: {source}")]
pub struct LampError {
    /// The output.
    pub path: PathBuf,
    /// What the system said.
    pub source: io::Error,
}

impl Output {
    fn new(path: &Path, pattern: fn(Health) -> Pattern) -> Self {
        let most = fs::read_to_string(path.with_file_name("max_brightness")).ok();
        let most = most.and_then(|most| most.trim().parse::<u32>().ok()).unwrap_or(1);
        Self { path: path.into(), pattern, on: most.to_string(), lit: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a fake LED and a fake GPIO line hold over so many steps of one health: `#` on, `.` off.
    fn shown(health: Health, steps: usize) -> [String; 2] {
        let sys = tempfile::tempdir().unwrap();
        let paths = ["leds", "gpio"].map(|name| sys.path().join(name).join("output"));
        for path in &paths {
            fs::create_dir(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        fs::write(paths[0].with_file_name("max_brightness"), "255\n").unwrap();
        let [path, buzzer] = paths.clone().map(Some);
        let mut lamp = Lamp::new(&LampConfig { path, buzzer });
        let mut shown = [String::new(), String::new()];
        for _ in 0..steps {
            lamp.show(health).unwrap();
            for ((shown, path), on) in shown.iter_mut().zip(&paths).zip(["255", "1"]) {
                let value = fs::read_to_string(path).unwrap();
                assert!(value == on || value == "0", "{value}");
                shown.push(if value == on { '#' } else { '.' });
            }
        }
        lamp.dark().unwrap();
        assert_eq!(paths.map(|path| fs::read_to_string(path).unwrap()), ["0", "0"]);
        shown
    }

    #[test]
    fn each_health_has_a_pattern_that_cannot_be_taken_for_another() {
        assert_eq!(shown(Health::Works, 16), ["################", "................"]);
        assert_eq!(shown(Health::Degraded, 16), ["####....####....", "#..............."]);
        assert_eq!(shown(Health::Broken, 16), ["#.#.#.#.#.#.#.#.", "#.......#......."]);
        assert_eq!(shown(Health::Degraded, 480)[1].matches('#').count(), 2);
    }

    #[test]
    fn an_output_that_is_not_there_is_named_and_not_made() {
        let path = tempfile::tempdir().unwrap().path().join("no-such-led");
        let mut lamp = Lamp::new(&LampConfig { path: Some(path.clone()), buzzer: None });
        assert!(lamp.show(Health::Works).unwrap_err().to_string().contains("no-such-led"));
        assert!(!path.exists());
        assert!(Lamp::new(&LampConfig::default()).show(Health::Broken).is_ok());
    }
}
