//! What the keys do.

use super::state::Page;

/// One line of keys for a page.
pub fn keys(page: Page, is_log: bool) -> String {
    let time = if is_log { "space pause  ,.<> seek" } else { "space freeze  r record" };
    match page {
        Page::Channels => format!("↑↓ Enter open  s sort  / filter  {time}  c clear  ? help  q quit"),
        Page::Message => format!("↑↓ ←→ fold  p plot  {time}  Esc back  ? help  q quit"),
        Page::Plot => format!("↑↓ p remove  + - time  z fill  {time}  ? help  q quit"),
        Page::Network => format!("{time}  c clear  Esc back  ? help  q quit"),
        Page::Help => "any key goes back".to_owned(),
    }
}

/// The page of help.
pub fn text(is_log: bool) -> String {
    let time = if is_log {
        "         space pause, go on   , . 1 s back, forth   < > 10 s   n next event
         [ ] slower, faster
"
    } else {
        "         space or f freeze: look around while it goes on counting
         r begin or end a recording
"
    };
    format!(
        "\
Pages    1 channels  2 message  3 plot  4 network  Tab next
Move     ↑ ↓ k j PgUp PgDn Home End      q or Ctrl-C end
Channels Enter: the fields of the last message
         s next column to sort by, S the other way round
         / filter: a regular expression anywhere in the name
Message  → unfold, ← fold or up, Enter either
         p plot the number, or plot it no more
Plot     + - more or less time   z each curve fills the plot   p remove
Anytime  c count anew
{time}
jitter   half the range of the middle 68 % of the intervals, over 2 s or
         16 intervals: the standard deviation, were it not for outliers
lost     by the messages' own counter (seq, tick) where they have one;
         ≤N: the sender lost N on all its channels, see page 4
late     came after a later message of the same sender
colors   red: an alarm (--alarm 'ROBOT_STATE rate<900'); gray: silent"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_fits_the_smallest_terminal() {
        for is_log in [false, true] {
            // 24 rows less head and foot.
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
