//! The text of a configuration as a tree in which every node knows its place: where a key is, what it holds, and the
//! tree without it.

use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// Longest value that a message repeats, in characters.
const SHOWN_CHARS_MAX: usize = 60;

/// One step from a node to one below it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// The value of a key.
    Key(String),
    /// An element of a list, from 0.
    Element(usize),
}

/// The way from the root to a node.
pub type KeyPath = Vec<Step>;

/// A path from its text, for example `patch[0].gauge.id`.
pub fn path_of(text: &str) -> KeyPath {
    let mut path = KeyPath::new();
    for part in text.split('.').filter(|part| !part.is_empty()) {
        let (key, elements) = part.split_once('[').unwrap_or((part, ""));
        path.push(Step::Key(key.to_owned()));
        let numbers = elements.split(['[', ']']).filter_map(|number| number.parse().ok());
        path.extend(numbers.map(Step::Element));
    }
    path
}

/// The text of a path.
pub fn text_of(path: &[Step]) -> String {
    path.iter().fold(String::new(), |text, step| match step {
        Step::Key(key) if text.is_empty() => key.clone(),
        Step::Key(key) => format!("{text}.{key}"),
        Step::Element(number) => format!("{text}[{number}]"),
    })
}

/// The node at a path: where it begins in the text (at its key, where it has one), and what it holds.
pub fn find<'t, 'i>(root: &'t DeTable<'i>, path: &[Step]) -> Option<(usize, &'t Spanned<DeValue<'i>>)> {
    let (Step::Key(first), rest) = path.split_first()? else { return None };
    let (key, value) = root.get_key_value(first.as_str())?;
    rest.iter().try_fold((key.span().start, value), |(_, node), step| match (step, node.get_ref()) {
        (Step::Key(name), DeValue::Table(table)) => {
            let (key, value) = table.get_key_value(name.as_str())?;
            Some((key.span().start, value))
        }
        (Step::Element(number), DeValue::Array(array)) => {
            let value = array.get(*number)?;
            Some((value.span().start, value))
        }
        _ => None,
    })
}

/// Takes a node away. False if there is none.
pub fn remove(root: &mut DeTable<'_>, path: &[Step]) -> bool {
    let Some((Step::Key(first), rest)) = path.split_first() else { return false };
    if rest.is_empty() {
        return root.remove(first.as_str()).is_some();
    }
    root.get_mut(first.as_str()).is_some_and(|value| remove_below(value.get_mut(), rest))
}

fn remove_below(node: &mut DeValue<'_>, path: &[Step]) -> bool {
    match (node, path) {
        (DeValue::Table(table), [Step::Key(key)]) => table.remove(key.as_str()).is_some(),
        (DeValue::Table(table), [Step::Key(key), rest @ ..]) => {
            table.get_mut(key.as_str()).is_some_and(|value| remove_below(value.get_mut(), rest))
        }
        (DeValue::Array(array), [Step::Element(number)]) => {
            let mut rest = DeArray::new();
            let others = array.iter().enumerate().filter(|(at, _)| at != number);
            others.for_each(|(_, item)| rest.push(item.clone()));
            let found = rest.len() < array.len();
            *array = rest;
            found
        }
        (DeValue::Array(array), [Step::Element(number), rest @ ..]) => {
            array.get_mut(*number).is_some_and(|value| remove_below(value.get_mut(), rest))
        }
        _ => false,
    }
}

/// The path in `original` of the node that is at `path` in `tree`, which is the same but for nodes that were taken away:
/// elements of lists have other numbers there.
pub fn original_path(tree: &DeTable<'_>, original: &DeTable<'_>, path: &[Step]) -> KeyPath {
    let mut there = KeyPath::new();
    for (depth, step) in path.iter().enumerate() {
        let Step::Element(number) = step else {
            there.push(step.clone());
            continue;
        };
        let begin = find(tree, &path[..=depth]).map(|(begin, _)| begin);
        let list = find(original, &there).and_then(|(_, node)| node.get_ref().as_array());
        let same = list.and_then(|list| list.iter().position(|item| Some(item.span().start) == begin));
        there.push(Step::Element(same.unwrap_or(*number)));
    }
    there
}

/// A value in words, for a message.
pub fn in_words(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text \"{}\"", shortened(text)),
        DeValue::Integer(number) => format!("the number {}", shortened(number.as_str())),
        DeValue::Float(number) => format!("the number {}", shortened(number.as_str())),
        DeValue::Boolean(word) => word.to_string(),
        DeValue::Datetime(moment) => format!("the time {moment}"),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// The beginning of a text, without what would break a line.
pub fn shortened(text: &str) -> String {
    let mut shown: String = text.chars().take(SHOWN_CHARS_MAX).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().count() > SHOWN_CHARS_MAX {
        shown.push_str("...");
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "a = 1\n[[p]]\nx = \"s\"\n[p.g]\nid = 5\n[[p]]\nx = \"t\"\n";

    #[test]
    fn a_path_is_its_text_and_leads_to_its_node() {
        let tree = DeTable::parse(TEXT).unwrap().into_inner();
        let path = path_of("p[0].g.id");
        assert_eq!(text_of(&path), "p[0].g.id");
        let (begin, node) = find(&tree, &path).unwrap();
        assert_eq!((TEXT[..begin].lines().count(), in_words(node.get_ref()).as_str()), (4, "the number 5"));
        assert!(find(&tree, &path_of("p[2]")).is_none() && find(&tree, &path_of("a.b")).is_none());
    }

    #[test]
    fn what_is_taken_away_is_gone_and_the_rest_is_found_by_its_first_number() {
        let original = DeTable::parse(TEXT).unwrap().into_inner();
        let mut tree = original.clone();
        assert!(remove(&mut tree, &path_of("p[0].g")) && !remove(&mut tree, &path_of("p[0].g")));
        assert!(remove(&mut tree, &path_of("p[0]")));
        let path = path_of("p[0].x");
        assert_eq!(in_words(find(&tree, &path).unwrap().1.get_ref()), "the text \"t\"");
        assert_eq!(text_of(&original_path(&tree, &original, &path)), "p[1].x");
    }

    #[test]
    fn long_values_are_shortened_and_stay_on_a_line() {
        assert_eq!(shortened(&format!("a\n{}", "x".repeat(80))), format!("a {}...", "x".repeat(58)));
    }
}
