//! Lists in pages, newest first.

use tonic::Status;

use crate::status::invalid;

const SIZE_DEFAULT: usize = 100;
const SIZE_MAX: usize = 1_000;

/// A page of `items`, which are oldest first and only ever grow at their end, so that the position of an item is a
/// stable token. Gives the items newest first, and the token of the next page or nothing.
pub(crate) fn page<T: Clone>(
    items: &[T],
    size: u32,
    token: &str,
    wanted: impl Fn(&T) -> bool,
) -> Result<(Vec<T>, String), Status> {
    let size = match size as usize {
        0 => SIZE_DEFAULT,
        size if size <= SIZE_MAX => size,
        size => return Err(invalid("page_size", format_args!("{size} is not in 0 to {SIZE_MAX}"))),
    };
    let end = if token.is_empty() {
        items.len()
    } else {
        let known = token.parse().ok().filter(|&end: &usize| end > 0 && end <= items.len());
        let short: String = token.chars().take(20).collect();
        known.ok_or_else(|| invalid("page_token", format_args!("`{short}` is not a token that this call gave")))?
    };
    let mut kept = items[..end].iter().enumerate().rev().filter(|(_, item)| wanted(item));
    let page: Vec<(usize, &T)> = kept.by_ref().take(size).collect();
    let more = kept.next().is_some();
    let next = page.last().filter(|_| more).map_or_else(String::new, |(position, _)| position.to_string());
    Ok((page.into_iter().map(|(_, item)| item.clone()).collect(), next))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_give_every_item_once_newest_first() {
        let items: Vec<u32> = (0..25).collect();
        let (mut seen, mut token) = (Vec::new(), String::new());
        loop {
            let (page, next) = page(&items, 4, &token, |n| n % 2 == 0).unwrap();
            assert!(!page.is_empty() && page.len() <= 4);
            seen.extend(page);
            token = next;
            if token.is_empty() {
                break;
            }
        }
        let even_down: Vec<u32> = (0..25).rev().filter(|n| n % 2 == 0).collect();
        assert_eq!(seen, even_down);
    }

    #[test]
    fn strange_tokens_and_sizes_are_refused() {
        let items = [1, 2, 3];
        for token in ["0", "4", "-1", "x", "99999999999999999999999999", " 1"] {
            assert_eq!(page(&items, 0, token, |_| true).unwrap_err().code(), tonic::Code::InvalidArgument, "{token}");
        }
        assert_eq!(page(&items, 1_001, "", |_| true).unwrap_err().code(), tonic::Code::InvalidArgument);
        assert_eq!(page::<u8>(&[], 0, "", |_| true).unwrap(), (vec![], String::new()));
    }
}
