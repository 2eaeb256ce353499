# One word for each chore. `make` alone lists them.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup build demo run test guard bench bindings lcm-spy

export PATH := $(PATH):$(HOME)/.cargo/bin
TARGET_DIR := $(or $(CARGO_TARGET_DIR),target)

help: ## list these targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## install what cargo cannot: liblcm, MuJoCo (quick when nothing is to be done)
	@scripts/setup.sh

build: setup ## build the command, TARGET_DIR/release/hoof
	cargo build --release --locked

demo: build ## simulate, log, replay bit for bit and report, in one go
	$(TARGET_DIR)/release/hoof demo

run: build ## HyQ in simulation, live: recorder, driver and controller as processes over LCM, one log, replayed
	$(TARGET_DIR)/release/hoof run runs/hyq_sim.toml --scenario scenarios/lie_stand_walk_sit.toml --seconds 20
	$(TARGET_DIR)/release/hoof replay logs/runs/hyq_sim.mcap

test: setup ## the gate: format, lints, tests, replay by other builds, documentation
	cargo fmt --all --check
	cargo clippy --release --locked --workspace --all-targets -- -D warnings
	cargo test --release --locked --workspace
	scripts/replay_across_builds.sh
	RUSTDOCFLAGS="-D warnings" cargo doc --release --locked --workspace --no-deps
	@# nalgebra's default features bring matrixmultiply, whose kernels give bits that depend on the CPU.
	@tree=$$(cargo tree --locked --package hoofprint --prefix none); \
	if grep '^matrixmultiply' <<<"$$tree"; then echo "error: matrixmultiply is in the build of hoofprint" >&2; exit 1; fi

guard: setup ## count the instructions of a replay and compare them with the stored ones (ACCEPT=1 stores them)
	cargo test --release --locked --workspace --test instructions

# BENCH='--rounds 3', BENCH='--into README.md': see bench run --help.
bench: build ## time the controller beside its peers and print the tables (installs the peers below TARGET_DIR/peers)
	scripts/bench_peers.sh $(TARGET_DIR)/peers
	@mkdir -p $(TARGET_DIR)/bench
	$(TARGET_DIR)/release/hoof sim --robot hyq --scenario scenarios/flat_trot.toml --log $(TARGET_DIR)/bench/flat_trot.mcap
	cargo run --release --locked --package benches --bin bench -- run $(TARGET_DIR)/bench --peers $(TARGET_DIR)/peers \
		--replay $(TARGET_DIR)/bench/flat_trot.mcap --json $(TARGET_DIR)/bench/speed.json $(BENCH)

lcm-spy: ## the stock lcm-spy with our types, below TARGET_DIR/lcm-spy (INSTALL=1 installs a JDK where there is none)
	@scripts/lcm_spy_jar.sh $(TARGET_DIR)/lcm-spy

bindings: ## regenerate the bindings of liblcm (needs libclang)
	scripts/regenerate_bindings.sh
