//! Questions to whoever sits at the terminal.

use std::io::{BufRead, IsTerminal, Write};

use super::failure::Outcome;

/// Whether there is somebody to ask.
pub fn somebody() -> bool {
    std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
}

/// Asks and gives the answer in small letters, without white space; empty if just Enter was pressed.
///
/// # Errors
/// If standard input cannot be read.
pub async fn ask(question: &str) -> Outcome<String> {
    let question = question.to_owned();
    let read = move || -> std::io::Result<String> {
        eprint!("{question} ");
        std::io::stderr().flush()?;
        let mut answer = String::new();
        std::io::stdin().lock().read_line(&mut answer)?;
        Ok(answer.trim().to_lowercase())
    };
    Ok(tokio::task::spawn_blocking(read).await.map_err(std::io::Error::other)??)
}

/// Asks for yes or no; Enter is yes.
///
/// # Errors
/// If standard input cannot be read.
pub async fn yes(question: &str) -> Outcome<bool> {
    let answer = ask(&format!("{question} [Y/n]")).await?;
    Ok(matches!(answer.as_str(), "" | "y" | "yes"))
}
