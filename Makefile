# The commands of daily work. `make demo` shows the product, `make check` proves it.
.PHONY: setup demo check fmt bench
DB := demo/demeter.sqlite
DEMETER := target/debug/demeter

# Debian packages and ONNX Runtime's library, where missing.
setup:
	@tools/setup.sh

# The bundled session becomes plants in a fresh database, and a picture of the first of them beside its photo.
demo: setup
	cargo build --locked --package demeter
	@rm -rf demo && mkdir demo
	$(DEMETER) replay tests/fixtures/row --db $(DB)
	$(DEMETER) plants show first --db $(DB) --picture demo/first-plant.png
	@echo "Picture: demo/first-plant.png"
	@echo "Page:    $(DEMETER) run --db $(DB), then open http://127.0.0.1:8420"

# Format, lints, dependency rules, every test.
check:
	@tools/check.sh

fmt:
	cargo fmt --all

# Times of the hot paths, in the profile that everything else shares.
bench: setup
	cargo bench --locked --workspace --profile dev --bench '*'
