//! Lists in pages, newest first.

use tonic::Status;

use crate::status::invalid;

const SIZE_DEFAULT: usize = 100;
const SIZE_MAX: usize = 1_000;

/// How many items a page has for which so many were asked.
pub(crate) fn page_size(size: u32) -> Result<usize, Status> {
    match size as usize {
        0 => Ok(SIZE_DEFAULT),
        size if size <= SIZE_MAX => Ok(size),
        size => Err(invalid("page_size", format_args!("{size} is not in 0 to {SIZE_MAX}"))),
    }
}

/// The number before which a page begins, of a list whose tokens are numbers.
pub(crate) fn before(token: &str) -> Result<u64, Status> {
    match token {
        "" => Ok(u64::MAX),
        token => token.parse().map_err(|_| invalid("page_token", "is not a token that this call gave: begin anew")),
    }
}

/// A page of `items`, which are oldest first. Gives the items newest first, and the token of the next page or nothing.
///
/// The token is the name of the last item shown: positions move when an item is deleted, names do not.
pub(crate) fn page<T: Clone>(
    items: &[T],
    size: u32,
    token: &str,
    name: impl Fn(&T) -> String,
    wanted: impl Fn(&T) -> bool,
) -> Result<(Vec<T>, String), Status> {
    let size = page_size(size)?;
    let end = if token.is_empty() {
        items.len()
    } else {
        let known = items.iter().position(|item| name(item) == token);
        let short: String = token.chars().take(20).collect();
        let problem = "is not a token that this call gave, or what it names was deleted: begin anew";
        known.ok_or_else(|| invalid("page_token", format_args!("`{short}` {problem}")))?
    };
    let mut kept = items[..end].iter().rev().filter(|item| wanted(item));
    let page: Vec<T> = kept.by_ref().take(size).cloned().collect();
    let more = kept.next().is_some();
    let next = page.last().filter(|_| more).map(&name).unwrap_or_default();
    Ok((page, next))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_deleted_between_two_pages_hides_nothing_else() {
        let mut items: Vec<u32> = (1..=9).collect();
        let (first, token) = page(&items, 3, "", u32::to_string, |_| true).unwrap();
        assert_eq!(first, [9, 8, 7]);
        items.retain(|n| ![2, 8].contains(n));
        let (rest, _) = page(&items, 9, &token, u32::to_string, |_| true).unwrap();
        assert_eq!(rest, [6, 5, 4, 3, 1]);
        items.retain(|n| *n != 7);
        let refused = page(&items, 9, &token, u32::to_string, |_| true).unwrap_err();
        assert!(refused.message().contains("was deleted: begin anew"), "{refused}");
    }

    #[test]
    fn strange_tokens_and_sizes_are_refused() {
        let items = [1, 2, 3];
        let code = |size, token| page(&items, size, token, i32::to_string, |_| true).unwrap_err().code();
        for token in ["0", "4", "-1", "x", "99999999999999999999999999", " 1"] {
            assert_eq!(code(0, token), tonic::Code::InvalidArgument, "{token}");
        }
        assert_eq!(code(1_001, ""), tonic::Code::InvalidArgument);
        assert_eq!(page(&[], 0, "", u8::to_string, |_| true).unwrap(), (vec![], String::new()));
    }
}
