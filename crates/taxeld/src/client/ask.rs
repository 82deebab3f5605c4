//! Questions at the terminal.

use std::io::{BufRead, IsTerminal, Write};

use super::failure::{Failure, Outcome};

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

/// Asks for yes or no where somebody is there to be asked; Enter is no. `agreed` answers for scripts: the option `--yes`.
///
/// # Errors
/// The answer is no, or nobody can be asked: `command` is what to type instead.
pub async fn agree(agreed: bool, question: &str, command: &str) -> Outcome {
    if agreed {
        return Ok(());
    }
    if !somebody() {
        let words = format!("{question} There is no terminal to answer on.");
        return Err(Failure::refused(words).help(format!("{command} --yes")));
    }
    if yes(question, false).await? { Ok(()) } else { Err(Failure::refused("nothing was changed")) }
}

/// Asks for yes or no; `enter` is what just Enter means.
///
/// # Errors
/// If standard input cannot be read.
pub async fn yes(question: &str, enter: bool) -> Outcome<bool> {
    let answer = ask(&format!("{question} [{}]", if enter { "Y/n" } else { "y/N" })).await?;
    Ok(if answer.is_empty() { enter } else { matches!(answer.as_str(), "y" | "yes") })
}
