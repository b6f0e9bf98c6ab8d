"""What commands need of the system: printing, interrupts, and programs run beside this one."""
