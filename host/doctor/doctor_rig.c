/* Emulated controllers and a kernel with CAN, for those who have neither. */
#include "doctor.h"

void doctor_rig(struct doctor *doctor)
{
    doctor_program(doctor, "rig", "arm-none-eabi-gcc", "gcc-arm-none-eabi", "controllers for Cortex-M and Cortex-R");
    doctor_program(doctor, "rig", "qemu-system-arm", "qemu-system-arm", "an emulated Cortex-M7");
    doctor_program(doctor, "rig", "qemu-system-aarch64", "qemu-system-arm", "an emulated Cortex-R5F with CAN");
    doctor_program(doctor, "rig", "linux.uml", "user-mode-linux", "SocketCAN in User-Mode Linux");
    doctor_program(doctor, "rig", "qemu-system-x86_64", "qemu-system-x86", "SocketCAN in QEMU");
}
