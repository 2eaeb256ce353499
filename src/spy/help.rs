//! Help texts for the keys.

use super::state::Page;

/// The keys of a page, in one line.
pub fn keys(page: Page, is_log: bool) -> String {
    let time = if is_log { "space pause  ,.<> seek" } else { "space freeze  r record" };
    match page {
        Page::Channels => format!("↑↓ Enter open  s sort  / filter  {time}  c clear  ? help  q quit"),
        Page::Message => format!("↑↓ ←→ fold  p plot  {time}  Esc back  ? help  q quit"),
        Page::Plot => format!("↑↓ p remove  + - time  z normalise  {time}  ? help  q quit"),
        Page::Network => format!("{time}  c clear  Esc back  ? help  q quit"),
        Page::Help => "any key: back".to_owned(),
    }
}

/// The help page.
pub fn text(is_log: bool) -> String {
    let time = if is_log {
        "         space pause, resume   , . seek 1 s   < > seek 10 s   n next event
         [ ] slower, faster
"
    } else {
        "         space or f freeze the display; counting continues
         r start or stop a recording
"
    };
    format!(
        "\
Pages    1 channels  2 message  3 plot  4 network  Tab next
Move     ↑ ↓ k j PgUp PgDn Home End      q or Ctrl-C end
Channels Enter: fields of the last message
         s sort by the next column, S reverse the order
         / filter: regular expression, matches any part of the name
Message  → expand, ← collapse or up, Enter toggle
         p plot the number, or remove its plot
Plot     + - time span   z normalise each curve   p remove
Any page c reset counts
{time}
jitter   half the range of the middle 68 % of the intervals, over 2 s or
         16 intervals: an outlier-robust standard deviation
lost     from the counter in the messages (seq, tick), if they have one;
         ≤N: the sender lost N on all its channels, see page 4
late     received after a later message of the same sender
colors   red: alarm (--alarm 'ROBOT_STATE rate<900'); gray: no messages"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_fits_80_by_24_characters() {
        for is_log in [false, true] {
            // 24 rows minus header and footer.
            assert!(text(is_log).lines().count() <= 20, "{}", text(is_log).lines().count());
            for page in [Page::Channels, Page::Message, Page::Plot, Page::Network, Page::Help] {
                let keys = keys(page, is_log);
                assert!(keys.chars().count() <= 80, "{keys}");
            }
            let longest = text(is_log).lines().map(|line| line.chars().count()).max();
            assert!(longest <= Some(80), "{longest:?}");
        }
    }
}
