//! The terminal: in a mode of its own while this program shows something, as it was after any end of it.

use std::io::{self, Stdout, stdout};

use ratatui_core::terminal::Terminal;
use ratatui_crossterm::CrosstermBackend;
use ratatui_crossterm::crossterm::cursor::Show;
use ratatui_crossterm::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyModifiers};
use ratatui_crossterm::crossterm::execute;
use ratatui_crossterm::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use taxel_client::Moment;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc::Sender;

use super::draw::draw;
use super::state::{News, Top};

/// The terminal while it shows something.
pub struct Screen(Terminal<CrosstermBackend<Stdout>>);

impl Screen {
    /// Takes the terminal; keys go to `to`, SIGTERM as `q`.
    ///
    /// # Errors
    /// A terminal that cannot be had.
    pub fn open(to: Sender<News>) -> anyhow::Result<Self> {
        let (mut ended, quit) = (signal(SignalKind::terminate())?, to.clone());
        tokio::spawn(async move { (ended.recv().await, quit.send(News::Key('q')).await) });
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            restore(); // else what it says would go with the screen
            before(panic);
        }));
        enable_raw_mode()?;
        let screen = Self(Terminal::new(CrosstermBackend::new(stdout()))?);
        execute!(stdout(), EnterAlternateScreen)?;
        crate::runtime::start(
            "keys",
            move || while key().is_some_and(|key| to.blocking_send(News::Key(key)).is_ok()) {},
        )?;
        Ok(screen)
    }

    /// Shows this.
    ///
    /// # Errors
    /// A terminal that has gone.
    pub fn draw(&mut self, top: &Top) -> io::Result<()> {
        self.0.draw(|frame| draw(top, Moment::now(), frame.area(), frame.buffer_mut())).map(drop)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore();
    }
}

/// Nobody can be told if this fails.
fn restore() {
    let _ = disable_raw_mode();
    let _ = execute!(stdout(), LeaveAlternateScreen, Show);
}

/// The next key: Ctrl-C is `q`, and what is no character is a space. `None` once there is no terminal.
fn key() -> Option<char> {
    Some(match event::read().ok()? {
        Event::Key(KeyEvent { code: KeyCode::Char('c'), modifiers: KeyModifiers::CONTROL, .. }) => 'q',
        Event::Key(KeyEvent { code: KeyCode::Char(key), .. }) => key,
        _ => ' ',
    })
}
