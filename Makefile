# One target for each task. `make` alone lists them.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup setup-tests build install demo run check check-steps test test-steps house guard bench bindings lcm-spy

export PATH := $(PATH):$(HOME)/.cargo/bin
TARGET_DIR := $(or $(CARGO_TARGET_DIR),target)

help: ## list these targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-11s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## install what cargo cannot: liblcm, MuJoCo (quick if they are present)
	@scripts/setup.sh

setup-tests: ## install what tests use, too
	@scripts/setup.sh --tests

build: setup ## build the command, TARGET_DIR/release/hoof
	cargo build --release --locked

# PREFIX=DIR: default /usr/local, or ~/.local for a user that may not write there.
install: build ## install hoof, libmujoco, robots, gaits, scenarios, stacks, completions and manual pages (PREFIX=DIR)
	scripts/install.sh $(TARGET_DIR)/release/hoof $(if $(PREFIX),"$(PREFIX)")

demo: build ## simulate, log, replay bit for bit and report, with one command
	$(TARGET_DIR)/release/hoof demo

run: build ## HyQ live in simulation: recorder, driver and controller as processes over LCM; the log is replayed
	$(TARGET_DIR)/release/hoof run runs/hyq_sim.toml --scenario scenarios/lie_stand_walk_sit.toml --seconds 20
	$(TARGET_DIR)/release/hoof replay logs/runs/hyq_sim.mcap

check: setup-tests ## for every commit: format, lints, names, import circles, fast tests (3 minutes warm)
	@scripts/timed.sh check $(TARGET_DIR) $(MAKE) --no-print-directory check-steps

check-steps:
	cargo fmt --all --check
	scripts/words.sh
	scripts/circles.sh
	scripts/newcomer.sh --edits
	cargo clippy --release --locked --workspace --all-targets -- -D warnings
	cargo test --release --locked --workspace --lib --bins
	cargo test --release --locked --package hoofprint --test errors --test robot
	cargo test --release --locked --package replay --test golden

test: setup-tests ## the gate: make check, all tests, replay by other builds, documentation
	@scripts/timed.sh test $(TARGET_DIR) $(MAKE) --no-print-directory test-steps

test-steps:
	cargo fmt --all --check
	scripts/words.sh
	scripts/circles.sh
	scripts/newcomer.sh --edits
	cargo clippy --release --locked --workspace --all-targets -- -D warnings
	cargo test --release --locked --workspace
	scripts/replay_across_builds.sh
	RUSTDOCFLAGS="-D warnings" cargo doc --release --locked --workspace --no-deps
	@# nalgebra's default features bring matrixmultiply, whose kernels give bits that depend on the CPU.
	@tree=$$(cargo tree --locked --package hoofprint --prefix none); \
	if grep '^matrixmultiply' <<<"$$tree"; then echo "error: matrixmultiply is in the build of hoofprint" >&2; exit 1; fi

# BASE=REVISION: golden logs must equal those of this revision.
house: ## judge the source tree: README length, circles, phrases, golden logs, newcomer tasks, minutes of check and test
	scripts/house.sh --target-dir $(TARGET_DIR) --base "$(or $(BASE),$(error make house needs BASE=REVISION))"

guard: setup-tests ## count the instructions of a replay and compare them with the stored counts (ACCEPT=1 stores new ones)
	cargo test --release --locked --workspace --test instructions

# BENCH='--rounds 3', BENCH='--into docs/measured.md': see bench run --help.
bench: build ## time the controller and other libraries and print the tables (builds the libraries below TARGET_DIR/peers)
	scripts/bench_peers.sh $(TARGET_DIR)/peers
	@mkdir -p $(TARGET_DIR)/bench
	$(TARGET_DIR)/release/hoof sim --robot hyq --scenario scenarios/flat_trot.toml --log $(TARGET_DIR)/bench/flat_trot.mcap
	cargo run --release --locked --package benches --bin bench -- run $(TARGET_DIR)/bench --peers $(TARGET_DIR)/peers \
		--replay $(TARGET_DIR)/bench/flat_trot.mcap --json $(TARGET_DIR)/bench/speed.json $(BENCH)

lcm-spy: ## the stock lcm-spy with our types, below TARGET_DIR/lcm-spy (INSTALL=1 installs a JDK if there is none)
	@scripts/lcm_spy_jar.sh $(TARGET_DIR)/lcm-spy

bindings: ## regenerate the bindings of liblcm (needs libclang)
	scripts/regenerate_bindings.sh
