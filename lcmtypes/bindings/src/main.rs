//! Prints Rust declarations of the part of liblcm that the bus uses. Run by `scripts/regenerate_bindings.sh`.

const FUNCTIONS: &str = "lcm_(create|destroy|subscribe|publish|handle_timeout|subscription_set_queue_capacity)";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bindings = bindgen::Builder::default()
        .header_contents("bus.h", "#include <lcm/lcm.h>")
        .allowlist_function(FUNCTIONS)
        .allowlist_var("LCM_MAX_CHANNEL_NAME_LENGTH")
        .opaque_type("_lcm_t|_lcm_subscription_t")
        .generate_comments(false)
        .merge_extern_blocks(true)
        .generate()?;
    bindings.write(Box::new(std::io::stdout()))?;
    Ok(())
}
