//! Keeps a page under each patch's name: makes what the machine had no room for, and what somebody removed. None of it is done
//! on the engine's task.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use taxel_engine::plan::Plan;
use taxel_rpc::STALLED_AFTER;
use taxel_shm::{Folder, Limits, Named, PageError, PageName, PageWriter, Permissions};
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

use crate::config::SharedMemorySection;
use crate::looking::{Problems, look_after};

/// How often it is looked whether each page still has its name.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Makes pages and looks after their names.
#[derive(Debug)]
pub struct Keeper {
    path: PathBuf,
    permissions: Permissions,
    /// Not yet, where the machine had no room for it, or somebody else had something in its place.
    folder: Option<Folder>,
    pages: Vec<Kept>,
    made: mpsc::Sender<(usize, PageWriter)>,
    problems: Problems,
}

/// What is known of the page of one patch.
#[derive(Debug)]
struct Kept {
    patch: String,
    limits: Limits,
    /// None until it was made once.
    name: Option<PageName>,
    /// What is wrong with it, as it was told last.
    problem: Option<String>,
}

impl Keeper {
    /// Makes the pages that can be made now. They come at the receiver, as do those that are made later.
    ///
    /// # Errors
    /// What is wrong with the folder or the group, but for what may pass: no controller has to do without the service for it.
    pub fn begin(
        section: &SharedMemorySection,
        plan: &Plan,
    ) -> anyhow::Result<(Self, mpsc::Receiver<(usize, PageWriter)>)> {
        let SharedMemorySection { path, group } = section;
        let group = group.as_ref().map(|name| {
            taxel_rpc::group_id(name).with_context(|| format!("shared_memory.group: there is no group `{name}`"))
        });
        let permissions = Permissions { mode: SharedMemorySection::MODE, group: group.transpose()? };
        let pages = plan.patches.iter().map(|patch| Kept {
            patch: patch.patch.name().to_owned(),
            limits: Limits { age: patch.live.stale_after, beat: STALLED_AFTER },
            name: None,
            problem: None,
        });
        let pages: Vec<Kept> = pages.collect();
        let (made, receiver) = mpsc::channel(pages.len().max(1));
        let problems = Problems::default();
        let mut keeper = Self { path: path.clone(), permissions, folder: None, pages, made, problems };
        let (problems, first) = keeper.look();
        if let Some(error) = first.filter(|error| !error.may_pass()) {
            return Err(error).context("shared_memory.path");
        }
        keeper.tell(problems);
        Ok((keeper, receiver))
    }

    /// Where it says what is wrong at present.
    pub fn problems(&self) -> Problems {
        self.problems.clone()
    }

    /// Starts to look every second until the daemon ends. Gives the end.
    ///
    /// # Errors
    /// If there is no thread to be had.
    pub fn keep(mut self, cancel: CancellationToken) -> anyhow::Result<impl Future<Output = ()> + use<>> {
        let look = move || {
            let (problems, _) = self.look();
            self.tell(problems);
        };
        look_after("pages", look, LOOK_EVERY, cancel)
    }

    /// Looks at each page and makes those that are not there. Gives what is wrong with each, and the first error.
    fn look(&mut self) -> (Vec<Option<String>>, Option<PageError>) {
        if !self.path.is_dir() {
            self.folder = None; // somebody removed all of it
        }
        let mut first = None;
        let problems = (0..self.pages.len()).map(|position| {
            let error = match self.pages[position].name.as_ref().map(PageName::look) {
                Some(Named::ThePage) => return None,
                Some(Named::Other) => return Some("something else has the name of its page".to_owned()),
                Some(Named::Nothing) | None => self.make(position).err()?,
            };
            let why = error.to_string();
            first.get_or_insert(error);
            Some(why)
        });
        (problems.collect(), first)
    }

    /// Tells the log what is new, and the health all that is wrong.
    fn tell(&mut self, problems: Vec<Option<String>>) {
        self.pages.iter_mut().zip(problems).for_each(|(page, problem)| page.tell(problem));
        self.problems.set(self.pages.iter().filter_map(Kept::words).collect());
    }

    fn make(&mut self, position: usize) -> Result<(), PageError> {
        let Kept { patch, limits, .. } = &self.pages[position];
        let folder = match &self.folder {
            Some(folder) => folder,
            None => self.folder.insert(Folder::open(&self.path, self.permissions)?),
        };
        let page = folder.page(patch, *limits)?;
        let name = page.name().clone();
        // Without room the engine has not taken the ones before: this one goes, and is made again at the next look.
        if self.made.try_send((position, page)).is_ok() && self.pages[position].name.replace(name).is_some() {
            tracing::warn!(patch = self.pages[position].patch, "its page in shared memory was removed: made again");
        }
        Ok(())
    }
}

impl Kept {
    /// Logs what is new about it.
    fn tell(&mut self, problem: Option<String>) {
        if self.problem == problem {
            return;
        }
        self.problem = problem;
        match self.words() {
            Some(words) => tracing::warn!("{words}"),
            None => tracing::info!(patch = self.patch, "the force is in shared memory again"),
        }
    }

    /// What is wrong with it, for people.
    fn words(&self) -> Option<String> {
        let problem = self.problem.as_ref()?;
        Some(format!("no force of {} in shared memory: {problem}", self.patch))
    }
}

#[cfg(all(test, feature = "sim"))]
mod tests {
    #![allow(clippy::unwrap_used)] // clippy exempts only functions that are tests themselves

    use std::os::unix::fs::PermissionsExt;
    use std::path::Path;

    use super::*;
    use crate::config;

    fn plan() -> Plan {
        let path = Path::new("demo_config.toml");
        let config = config::parse(path, include_str!("../demo_config.toml")).unwrap();
        config::resolve(&config, path).unwrap().plan
    }

    #[test]
    fn a_page_that_is_gone_is_made_again_and_one_that_has_another_s_name_is_told() {
        let memory = tempfile::Builder::new().prefix("taxeld-test-").tempdir_in("/dev/shm").unwrap();
        let section = SharedMemorySection { path: memory.path().join("pages"), ..SharedMemorySection::default() };
        let (mut keeper, mut made) = Keeper::begin(&section, &plan()).unwrap();
        let mut look = move || {
            let (problems, _) = keeper.look();
            keeper.tell(problems);
            keeper.problems().get()
        };
        let (_, first) = made.try_recv().unwrap();
        let path = first.path().to_owned();
        assert_eq!((look(), made.try_recv().is_err()), (Vec::new(), true));

        std::fs::remove_file(&path).unwrap();
        assert_eq!(look(), Vec::<String>::new());
        let (_, second) = made.try_recv().unwrap();
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
        assert_eq!(look(), Vec::<String>::new(), "with its folder, too");
        let (_, third) = made.try_recv().unwrap();
        assert_eq!((third.path(), third.name().look()), (&*path, Named::ThePage));
        drop((first, second));
        assert_eq!(third.name().look(), Named::ThePage);

        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "").unwrap();
        let name = &plan().patches[0].patch.name().to_owned();
        assert_eq!(look(), [format!("no force of {name} in shared memory: something else has the name of its page")]);
        assert!(made.try_recv().is_err(), "nothing of others is replaced");
        std::fs::remove_file(&path).unwrap();
        assert_eq!((look(), made.try_recv().is_ok()), (Vec::new(), true));
    }

    #[test]
    fn what_somebody_else_has_put_in_the_folder_s_place_ends_no_daemon() {
        let memory = tempfile::Builder::new().prefix("taxeld-test-").tempdir_in("/dev/shm").unwrap();
        let section = SharedMemorySection { path: memory.path().join("pages"), ..SharedMemorySection::default() };
        let name = &plan().patches[0].patch.name().to_owned();
        let (put, others) = (|| std::fs::create_dir(&section.path).unwrap(), std::fs::Permissions::from_mode(0o777));
        put();
        std::fs::set_permissions(&section.path, others).unwrap();
        let (mut keeper, mut made) = Keeper::begin(&section, &plan()).unwrap();
        let said = keeper.problems().get().join("");
        assert!(said.contains(name) && said.contains("others could put pages of their own there"), "{said}");
        assert!(made.try_recv().is_err());

        std::fs::remove_dir(&section.path).unwrap();
        assert_eq!(keeper.look().0, [None]);
        assert!(made.try_recv().is_ok(), "its page is made once the place is free");
    }
}
