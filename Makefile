# Trocar. `make help` lists the targets.
#
# Sources are found by pattern, so a new file needs no line here:
#   firmware/*.c shared/*.c          freestanding, single precision      -> build/libfirmware.a
#   firmware/effects/*.c             the same; an image has those that its scene names (shared/effects.def)
#   firmware/ports/NAME/             a port, described by its port.mk    -> build/firmware/NAME/controller.elf
#   host/*/*.c sim/*.c               hosted                              -> build/libtrocar.a
#   host/*/NAME_main.c               a program of its own                -> build/NAME
#   tests/DIR/test_*.c, *.t          a test that speaks TAP              -> make test
# SAN=1 builds the same under AddressSanitizer and UBSan into build/san. V=1 shows the commands.

SHELL := /bin/sh
.DELETE_ON_ERROR:
.SUFFIXES:
.DEFAULT_GOAL := all
# All processors, unless the command line says -j.
ifeq ($(MAKELEVEL),0)
MAKEFLAGS += -j$(shell nproc 2>/dev/null || echo 1)
endif

comma := ,
B := build$(if $(SAN),/san)
CC := gcc
HOST_DIRS := $(patsubst %/,%,$(wildcard host/*/))
HOST_INCLUDE := $(addprefix -I,shared firmware sim $(HOST_DIRS)) -I/usr/include/suitesparse
PACKAGES := gsl libwebsockets yaml-0.1 expat zlib json-c libcrypto
WARN := -Wall -Wextra -Wshadow -Wpointer-arith -Wstrict-prototypes -Wmissing-prototypes -Wwrite-strings -Wvla -Werror
SANITIZE := $(if $(SAN),-fsanitize=address$(comma)undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
# -ffp-contract=off: the same products and sums on every target; -fno-math-errno: no libm call hides behind an operator
ARITHMETIC := -ffp-contract=off -fno-math-errno -fno-strict-aliasing
CFLAGS := -std=c11 -O2 -g -D_GNU_SOURCE $(WARN) $(ARITHMETIC) $(SANITIZE)
FREESTANDING := -std=c11 -O2 -g $(WARN) -Wdouble-promotion -Wconversion -Wno-sign-conversion $(ARITHMETIC) \
  -ffreestanding -fno-builtin -fstack-usage -Ishared -Ifirmware
FIRMWARE_FLAGS := $(FREESTANDING) $(SANITIZE)
# Expanded only when a link runs, so pkg-config may be installed by the same make.
LIBS = -lcholmod -lcamd -lamd -lcolamd -lccolamd -lsuitesparseconfig -llapacke -lopenblas \
  $(shell pkg-config --libs $(PACKAGES)) -lm -lpthread

FIRMWARE_SRC := $(wildcard firmware/*.c firmware/effects/*.c shared/*.c)
HOST_SRC := $(filter-out %_main.c,$(wildcard host/*/*.c sim/*.c))
HOST_ASM := $(wildcard host/*/*.S)
MAINS := $(wildcard host/*/*_main.c)
PROGRAMS := $(foreach m,$(MAINS),$(B)/$(patsubst %_main.c,%,$(notdir $(m))))
FIRMWARE_OBJ := $(FIRMWARE_SRC:%.c=$(B)/obj/%.o)
HOST_OBJ := $(HOST_SRC:%.c=$(B)/obj/%.o) $(HOST_ASM:%.S=$(B)/obj/%.o)
TEST_SRC := $(wildcard tests/*/test_*.c) tests/rig/recorder.c tests/rig/socketcan_probe.c
TEST_BIN := $(TEST_SRC:tests/%.c=$(B)/tests/%)
# Tests that run a second time under the sanitisers: bad input and the loop, not the long accuracy runs.
SANITISED_DIRS := unit hard wire loop can fuzz

Q := $(if $(V),,@)
say = @printf '  %-4s %s\n' $(1) $(2)

.PHONY: all
all: $(PROGRAMS) $(if $(SAN),,ports) ## build everything under build/

# What must be installed first. Only the targets that a newcomer types install; others check, and say what to run.
INSTALLING := $(filter demo test deps,$(MAKECMDGOALS))
.PHONY: packages test-packages
packages:
	@host/dependencies.sh $(if $(INSTALLING),,--check) build
test-packages: | packages
	@host/dependencies.sh $(if $(INSTALLING),,--check) test

$(B)/obj/firmware/%.o: firmware/%.c | packages
	@mkdir -p $(@D)
	$(call say,CC,$<)
	$(Q)$(CC) $(FIRMWARE_FLAGS) -MMD -MP -c $< -o $@

$(B)/obj/shared/%.o: shared/%.c | packages
	@mkdir -p $(@D)
	$(call say,CC,$<)
	$(Q)$(CC) $(FIRMWARE_FLAGS) -MMD -MP -c $< -o $@

$(B)/obj/%.o: %.c | packages
	@mkdir -p $(@D)
	$(call say,CC,$<)
	$(Q)$(CC) $(CFLAGS) $(HOST_INCLUDE) -MMD -MP -c $< -o $@

$(B)/obj/%.o: %.S | packages
	@mkdir -p $(@D)
	$(call say,AS,$<)
	$(Q)$(CC) -MMD -MP -c $< -o $@

# The assembler includes the page and the protocol as they are; it writes no dependencies.
$(B)/obj/host/view/page_bytes.o: $(wildcard host/view/page/*)
$(B)/obj/host/wire/wire_dbc_text.o: shared/wire.dbc

$(B)/libfirmware.a: $(FIRMWARE_OBJ)
	@rm -f $@
	$(Q)ar rcs $@ $^

$(B)/libtrocar.a: $(HOST_OBJ)
	@rm -f $@
	$(Q)ar rcs $@ $^

define program
$(B)/$(patsubst %_main.c,%,$(notdir $(1))): $(B)/obj/$(1:.c=.o) $(B)/libtrocar.a $(B)/libfirmware.a
	$$(call say,LINK,$$@)
	$$(Q)$(CC) $(CFLAGS) $$^ -o $$@ $$(LIBS)
endef
$(foreach m,$(filter-out %/trocar-mesher_main.c,$(MAINS)),$(eval $(call program,$(m))))

# Gmsh is large and may end a process by itself: it lives in a program of its own.
$(B)/trocar-mesher: $(B)/obj/host/mesh/trocar-mesher_main.o $(B)/libtrocar.a $(B)/libfirmware.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(CFLAGS) $^ -o $@ -lgmsh $(LIBS)

# what a single test needs beside
$(B)/tests/unit/test_convex: TEST_LIBS := -lccd

$(B)/tests/%: tests/%.c $(B)/libtrocar.a $(B)/libfirmware.a | test-packages
	@mkdir -p $(@D)
	$(call say,TEST,$<)
	$(Q)$(CC) $(CFLAGS) $(HOST_INCLUDE) -Itests -MMD -MP -MF $@.d -MT $@ $< $(B)/libtrocar.a $(B)/libfirmware.a \
	  -o $@ -lcmocka $(TEST_LIBS) $(LIBS)

# An image: EFFECTS, names of shared/effects.def, and IMAGE, the folder below the port's. Without them it is the base image. It
# is made of the base, its effects and the parts that these share, and says to the compiler which they are.
EFFECTS :=
IMAGE :=
effect_field = $(shell sed -n 's/^EFFECT.[0-9]*, *[A-Z_]*, *$(1), *[A-Z0-9_]*, *"\([^"]*\)".*/$(2)/p' shared/effects.def)
EFFECT_FILES := $(sort $(EFFECTS) $(foreach e,$(EFFECTS),$(call effect_field,$(e),\1)))
IMAGE_SRC := $(wildcard firmware/*.c shared/*.c) $(EFFECT_FILES:%=firmware/effects/%.c)
IMAGE_FLAGS := -DTROCAR_IMAGE $(EFFECTS:%=-DTROCAR_HAS_%)

# A port: firmware/ports/NAME/port.mk says $(eval $(call port,NAME,compiler,flags of all objects,flags of the port's own
# objects,link flags and libraries)), and in NAME_MORE before it what else the port is made of: drivers, parts of other ports.
# The controller's objects are the freestanding ones for every port; a port whose compiler is not installed is left out, and said
# so. A compiler cache would not keep the call graph that `make budgets` reads.
PORTS :=
define port
$(1)_DIR := $(B)/firmware/$(1)$(IMAGE:%=/%)
ifneq ($$(shell command -v $(2) 2>/dev/null)$$(filter gcc,$(2)),)
PORTS += $$($(1)_DIR)/controller.elf
else
PORTS += without-$(1)
endif
.PHONY: without-$(1)
without-$(1):
	@echo '  port $(1) is left out: $(2) is not installed'
$(1)_OBJ := $$(patsubst %,$$($(1)_DIR)/%.o,$$(basename $$(IMAGE_SRC) $$(wildcard firmware/ports/$(1)/*.[cS]) $$($(1)_MORE)))
$$($(1)_DIR)/firmware/ports/%.o: firmware/ports/%.c $$($(1)_DIR)/image.effects | packages
	@mkdir -p $$(@D)
	$$(Q)CCACHE_DISABLE=1 $(2) $(4) $(3) $$(IMAGE_FLAGS) -Ishared -Ifirmware -MMD -MP -c $$< -o $$@
$$($(1)_DIR)/%.o: %.c $$($(1)_DIR)/image.effects | packages
	@mkdir -p $$(@D)
	$$(Q)CCACHE_DISABLE=1 $(2) $(FREESTANDING) $$(IMAGE_FLAGS) $(3) -MMD -MP -c $$< -o $$@
$$($(1)_DIR)/%.o: %.S | packages
	@mkdir -p $$(@D)
	$$(Q)$(2) $(3) -MMD -MP -c $$< -o $$@
$$($(1)_DIR)/controller.elf: $$($(1)_OBJ)
	$$(call say,LINK,$$@)
	$$(Q)$(2) $(3) $$($(1)_OBJ) -Wl,-Map=$$(@:.elf=.map) -o $$@ $(5)
	$$(if $$(filter %-gcc,$(2)),$$(Q)$$(patsubst %-gcc,%-objcopy,$(2)) -O binary $$@ $$(@:.elf=.bin))
# which effects its objects were compiled for: they are compiled again when that changes
$$($(1)_DIR)/image.effects: always
	@mkdir -p $$(@D)
	@echo '$$(EFFECTS)' | cmp -s - $$@ || echo '$$(EFFECTS)' >$$@
endef
.PHONY: always
always:
-include $(wildcard firmware/ports/*/port.mk)

# Ports on which tests/rig/replay.t runs every effect.
EMULATED := $(filter $(PORTS:$(B)/firmware/%/controller.elf=%),cortex_m7_an500 cortex_r5_zcu102)
.PHONY: ports
ports: $(B)/libfirmware.a $(PORTS) ## the controller for each port whose compiler is here, without effects, and some with all
	@for port in native $(EMULATED); do $(MAKE) --no-print-directory image IMAGE=all PORT=$$port \
	  EFFECTS='$(call effect_field,\([a-z_]*\),\1)' || exit 1; done

-include $(shell find $(B) -name '*.d' 2>/dev/null)

# The effects that a scene names decide what its images are made of.
SCENE_FILE = $(if $(filter %.yaml %.bank,$(SCENE))$(findstring /,$(SCENE)),$(SCENE),host/scenes/demo/$(SCENE).yaml)
.PHONY: firmware
firmware: $(B)/trocar ## the controller for one scene (SCENE=name or a scene or bank file, PORT=name; default: every port)
	@test -n '$(SCENE)' || { echo 'firmware: say for which scene: make firmware SCENE=name PORT=name' >&2; exit 2; }
	@names=$$($(B)/trocar info --effects '$(SCENE_FILE)') && $(MAKE) --no-print-directory image \
	  IMAGE='$(basename $(notdir $(SCENE_FILE)))' EFFECTS="$$names" PORT='$(PORT)'
.PHONY: image
image: $(if $(PORT),$(filter $(B)/firmware/$(PORT)/%,$(PORTS)),$(PORTS))
	@test -n '$(if $(PORT),$(filter $(B)/firmware/$(PORT)/%,$(PORTS)),$(PORTS))' || { \
	  echo 'firmware: there is no port $(PORT), or its compiler is not installed' >&2; exit 2; }

.PHONY: demo
demo: all | packages ## make an organ, build its bank, press it, compare with finite elements (SCENE=name HOLD=1)
	@B=$(B) host/cli/demo.sh

.PHONY: test
test: all $(TEST_BIN) sanitised | test-packages ## everything that must hold (T=word: only tests whose path has the word)
	@$(MAKE) --no-print-directory ports
	@tests/run.py --build $(B) --sanitised $(B)/san:$(subst $() $(),$(comma),$(SANITISED_DIRS)) $(T)

.PHONY: sanitised sanitised-programs
sanitised: | test-packages
	@$(MAKE) --no-print-directory SAN=1 B=$(B)/san sanitised-programs
sanitised-programs: $(PROGRAMS) $(filter $(SANITISED_DIRS:%=$(B)/tests/%/%),$(TEST_BIN))

.PHONY: bench
bench: $(B)/tests/bench/precompute | test-packages ## how long the precomputation takes beside plain solves and conjugate gradients
	@$<

.PHONY: sizes
sizes: $(B)/tests/bench/sizes | test-packages ## bytes of a compressed bank at 1, 0.5 and 0.1 % force error, on two livers (many minutes)
	@$<

.PHONY: lint
lint: | test-packages ## format, static analysis and the rules of the code
	@tests/run.py --build $(B) tests/lint/

.PHONY: format
format: | test-packages ## lay out the C files
	@clang-format -i $$(git ls-files '*.c' '*.h')

.PHONY: budgets
budgets: all $(B)/tests/rig/recorder | test-packages ## flash, memory, stack and instructions per tick on each port
	@B=$(B) tests/rig/budgets.t --table

.PHONY: jitter
jitter: all $(B)/tests/rig/socketcan_probe | test-packages ## how late this machine begins ticks, over a minute, beside its own limits
	@B=$(B) tests/rig/jitter.py

.PHONY: effects
effects: all $(B)/tests/rig/recorder | test-packages ## what each effect costs and changes: flash, memory, bank, instructions per tick
	@B=$(B) tests/rig/effects.py

.PHONY: fresh
fresh: ## both commands from a clean clone in a bare Debian 12 root (as root, network, many minutes)
	@tests/rig/fresh.sh . sh -c 'make demo && make test'

.PHONY: deps
deps: test-packages ## install the packages that building and testing need

.PHONY: clean
clean: ## remove build/
	rm -rf build

.PHONY: help
help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-8s %s\n", $$1, $$2}' Makefile
