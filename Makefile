# Trocar. `make help` lists the targets.
#
# Sources are found by pattern, so a new file needs no line here:
#   firmware/*.c shared/*.c          freestanding, single precision      -> build/libfirmware.a
#   host/*/*.c sim/*.c               hosted                              -> build/libtrocar.a
#   host/*/NAME_main.c               a program of its own                -> build/NAME
#   tests/DIR/test_*.c, *.t          a test that speaks TAP              -> make test
# SAN=1 builds the same under AddressSanitizer and UBSan into build/san.

SHELL := /bin/sh
.DELETE_ON_ERROR:
.SUFFIXES:
.DEFAULT_GOAL := all

B := build$(if $(SAN),/san)
CC := gcc
HOST_DIRS := $(patsubst %/,%,$(wildcard host/*/))
HOST_INCLUDE := $(addprefix -I,shared firmware sim $(HOST_DIRS)) -I/usr/include/suitesparse
PACKAGES := gsl libwebsockets yaml-0.1 expat zlib json-c libcrypto
WARN := -Wall -Wextra -Wshadow -Wpointer-arith -Wstrict-prototypes -Wmissing-prototypes -Wwrite-strings -Wvla -Werror
SANITIZE := $(if $(SAN),-fsanitize=address$(comma)undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
comma := ,
# -ffp-contract=off: the same products and sums on every target; -fno-math-errno: no libm call hides behind an operator
ARITHMETIC := -ffp-contract=off -fno-math-errno -fno-strict-aliasing
CFLAGS := -std=c11 -O2 -g -D_GNU_SOURCE $(WARN) $(ARITHMETIC) $(SANITIZE)
FIRMWARE_FLAGS := -std=c11 -O2 -g $(WARN) -Wdouble-promotion -Wconversion -Wno-sign-conversion $(ARITHMETIC) \
  -ffreestanding -fno-builtin -fstack-usage $(SANITIZE) -Ishared -Ifirmware
LIBS = -lcholmod -lcamd -lamd -lcolamd -lccolamd -lsuitesparseconfig -llapacke -lopenblas \
  $(shell pkg-config --libs $(PACKAGES)) -lm -lpthread

FIRMWARE_SRC := $(wildcard firmware/*.c shared/*.c)
HOST_SRC := $(filter-out %_main.c,$(wildcard host/*/*.c sim/*.c))
HOST_ASM := $(wildcard host/*/*.S)
MAINS := $(wildcard host/*/*_main.c)
PROGRAMS := $(foreach m,$(MAINS),$(B)/$(patsubst %_main.c,%,$(notdir $(m))))
FIRMWARE_OBJ := $(FIRMWARE_SRC:%.c=$(B)/obj/%.o)
HOST_OBJ := $(HOST_SRC:%.c=$(B)/obj/%.o) $(HOST_ASM:%.S=$(B)/obj/%.o)
TEST_SRC := $(wildcard tests/*/test_*.c)
TEST_BIN := $(TEST_SRC:tests/%.c=$(B)/tests/%)
TEST_SCRIPTS := $(wildcard tests/*/*.t)

.PHONY: all
all: $(PROGRAMS) ports ## build everything under build/

$(B)/obj/firmware/%.o: firmware/%.c
	@mkdir -p $(@D)
	$(CC) $(FIRMWARE_FLAGS) -MMD -MP -c $< -o $@

$(B)/obj/shared/%.o: shared/%.c
	@mkdir -p $(@D)
	$(CC) $(FIRMWARE_FLAGS) -MMD -MP -c $< -o $@

$(B)/obj/%.o: %.c
	@mkdir -p $(@D)
	$(CC) $(CFLAGS) $(HOST_INCLUDE) -MMD -MP -c $< -o $@

$(B)/obj/%.o: %.S
	@mkdir -p $(@D)
	$(CC) -MMD -MP -c $< -o $@

$(B)/libfirmware.a: $(FIRMWARE_OBJ)
	@rm -f $@
	ar rcs $@ $^

$(B)/libtrocar.a: $(HOST_OBJ)
	@rm -f $@
	ar rcs $@ $^

define program
$(B)/$(patsubst %_main.c,%,$(notdir $(1))): $(B)/obj/$(1:.c=.o) $(B)/libtrocar.a $(B)/libfirmware.a
	$(CC) $(CFLAGS) $$^ -o $$@ $$(LIBS)
endef
$(foreach m,$(filter-out %/trocar-mesher_main.c,$(MAINS)),$(eval $(call program,$(m))))

# Gmsh is large and may end a process by itself: it lives in a program of its own.
$(B)/trocar-mesher: $(B)/obj/host/mesh/trocar-mesher_main.o $(B)/libtrocar.a $(B)/libfirmware.a
	$(CC) $(CFLAGS) $^ -o $@ -lgmsh $(LIBS)

$(B)/tests/%: tests/%.c $(B)/libtrocar.a $(B)/libfirmware.a
	@mkdir -p $(@D)
	$(CC) $(CFLAGS) $(HOST_INCLUDE) -Itests -MMD -MP $< $(B)/libtrocar.a $(B)/libfirmware.a -o $@ -lcmocka $(LIBS)

.PHONY: ports
ports: $(B)/libfirmware.a ## the controller for each port that can be built here

-include $(shell find $(B) -name '*.d' 2>/dev/null)

.PHONY: clean
clean: ## remove build/
	rm -rf build

.PHONY: help
help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
