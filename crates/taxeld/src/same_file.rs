//! Which file a path is, whatever it is called there: no output of a command overwrites an input or another output.

use std::ffi::OsString;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use anyhow::bail;

use crate::files;

/// Device and inode.
type Inode = (u64, u64);

/// What tells a file from all others.
#[derive(Debug, PartialEq, Eq)]
enum WhichFile {
    /// One that is there: links to it and further names of it are the same.
    There(Inode),
    /// One that will be made: the name that it gets in its folder.
    New(Inode, OsString),
}

impl WhichFile {
    /// `None` for what no output overwrites: a standard stream, a device, a pipe, a folder, or a path without a folder.
    fn of(path: &Path) -> Option<Self> {
        let inode = |found: Metadata| (found.dev(), found.ino());
        if files::is_standard(path) {
            return None;
        }
        if let Ok(found) = std::fs::metadata(path) {
            return found.is_file().then(|| Self::There(inode(found)));
        }
        let path = taxel_store::real(path);
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(Self::New(inode(std::fs::metadata(folder).ok()?), path.file_name()?.to_owned()))
    }
}

/// Refuses outputs of which one is an input or another output, by whatever name.
///
/// # Errors
/// Both names.
pub fn refuse_overwriting(outputs: &[impl AsRef<Path>], inputs: &[impl AsRef<Path>]) -> anyhow::Result<()> {
    let inputs: Vec<_> =
        inputs.iter().map(AsRef::as_ref).map(|input| (WhichFile::of(&files::named(input.to_owned())), input)).collect();
    for output in outputs.iter().map(AsRef::as_ref) {
        let Some(file) = WhichFile::of(output) else { continue };
        if let Some((_, input)) = inputs.iter().find(|(input, _)| input.as_ref() == Some(&file)) {
            bail!("{} would be overwritten by the output {}: name another file", input.display(), output.display());
        }
    }
    refuse_one_file(outputs)
}

/// Refuses outputs of which two are one file: the second would overwrite the first. Nothing is lost where both are `/dev/null`.
///
/// # Errors
/// Both names.
fn refuse_one_file(outputs: &[impl AsRef<Path>]) -> anyhow::Result<()> {
    let mut before: Vec<(Option<WhichFile>, &Path)> = Vec::new();
    for output in outputs.iter().map(AsRef::as_ref).filter(|output| *output != Path::new("/dev/null")) {
        let file = WhichFile::of(output);
        let same = |(other, name): &&(Option<WhichFile>, &Path)| *name == output || (file.is_some() && *other == file);
        if let Some((_, other)) = before.iter().find(same) {
            bail!("two outputs go to one file, {} and {}: expected two files", other.display(), output.display());
        }
        before.push((file, output));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    const NOTHING: &[&str] = &[];

    #[test]
    fn an_output_that_is_an_input_is_refused_by_any_of_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let [data, other, link, name] =
            ["data.csv", "other.csv", "link.csv", "name.csv"].map(|name| folder.path().join(name));
        std::fs::write(&data, "t_s").unwrap();
        symlink(&data, &link).unwrap();
        std::fs::hard_link(&data, &name).unwrap();
        for same in [&data, &link, &name, &folder.path().join(".").join("data.csv")] {
            let error = refuse_overwriting(&[same], &[&other, &data]).unwrap_err().to_string();
            assert!(error.contains("would be overwritten"), "{error}");
        }
        refuse_overwriting(&[&other], &[&data]).unwrap();
        refuse_overwriting(&[Path::new("-")], &[Path::new("-"), &data]).unwrap();
        refuse_overwriting(&["/dev/null"], &["/dev/null"]).unwrap();
    }

    #[test]
    fn two_outputs_that_are_or_will_be_one_file_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("in")).unwrap();
        std::fs::write(at("there.csv"), "t_s").unwrap();
        std::fs::hard_link(at("there.csv"), at("name.csv")).unwrap();
        for (target, link) in [("there.csv", "link.csv"), ("in", "folder"), ("in/new.csv", "dangling.csv")] {
            symlink(target, at(link)).unwrap();
        }
        for (first, second) in [
            ("new.csv", "new.csv"),
            ("new.csv", "./new.csv"),
            ("new.csv", "in/../new.csv"),
            ("in/new.csv", "folder/new.csv"),
            ("in/new.csv", "dangling.csv"),
            ("there.csv", "link.csv"),
            ("there.csv", "name.csv"),
        ] {
            for outputs in [[at(first), at(second)], [at(second), at(first)]] {
                let error = refuse_overwriting(&outputs, NOTHING).unwrap_err().to_string();
                assert!(error.starts_with("two outputs go to "), "{error}");
            }
        }
        assert!(refuse_one_file(&["-", "-"]).is_err() && refuse_one_file(&["new.csv", "./new.csv"]).is_err());
        for (first, second) in [("new.csv", "there.csv"), ("new.csv", "New.csv"), ("new.csv", "in/new.csv")] {
            refuse_overwriting(&[at(first), at(second)], NOTHING).unwrap();
        }
        refuse_one_file(&["/dev/null", "/dev/null"]).unwrap();
    }
}
